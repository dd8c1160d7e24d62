"""The geometry of a robot: one number for each parameter of its mechanism."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array


class _Numbers:
    """What one geometry and a batch of them have in common."""

    __slots__ = ()
    parameters: ParameterSet
    vector: Array
    _arrays: dict[str, Array]

    def __getitem__(self, symbol: str) -> Array:
        # Newton's method asks for them at every step: the views are made once.
        if symbol not in self._arrays:
            self._arrays[symbol] = self.parameters.array(self.vector, symbol)
        return self._arrays[symbol]

    def once(self, name: str, compute: Callable[[], Array]) -> Array:
        """What follows from the geometry alone, under a name that is no symbol: computed once."""
        if name not in self._arrays:
            self._arrays[name] = compute()
        return self._arrays[name]

    def with_numbers(self, parameters: ParameterSet, vector: Array) -> Self:
        """Other numbers for the same poses."""
        return type(self)(parameters, vector)  # type: ignore[call-arg]

    def interpolate_from(self, start: Geometry, fraction: float) -> Self:
        """Linear interpolation from one geometry: 0 gives ``start`` for each pose, 1 gives this."""
        return self.with_numbers(self.parameters, (1.0 - fraction) * start.vector + fraction * self.vector)


@dataclass(frozen=True, slots=True, eq=False)
class Geometry(_Numbers):
    """The parameters of one robot, in their own units.

    ``vector`` (P,) is a read-only copy, in the order of ``parameters``; ``geometry["S"]`` is the array
    of one kind, ``(6, 3)`` or ``(6,)``.

    Raises:
        ValueError: the vector does not have one number for each parameter.
    """

    parameters: ParameterSet
    vector: Array
    _arrays: dict[str, Array] = field(repr=False)

    def __init__(self, parameters: ParameterSet, vector: ArrayLike) -> None:
        values = np.array(vector, dtype=float)
        if values.shape != (len(parameters),):
            raise ValueError(f"a geometry has {len(parameters)} numbers, not the shape {values.shape}")
        values.setflags(write=False)
        object.__setattr__(self, "parameters", parameters)
        object.__setattr__(self, "vector", values)
        object.__setattr__(self, "_arrays", {})

    @classmethod
    def of(cls, parameters: ParameterSet, values: Mapping[str, ArrayLike]) -> Geometry:
        """The geometry of a document: nested lists under the symbols of the kinds.

        Raises:
            ValueError: a kind has a wrong shape.
        """
        return cls(parameters, parameters.vector(values))

    def document(self) -> dict[str, Any]:
        """Nested lists under the symbols of the kinds, the form of every file."""
        return self.parameters.document(self.vector)

    def largest_difference(self, other: Geometry) -> float:
        """Largest absolute difference of a parameter, mm; mrad of an angle."""
        return float(np.max(np.abs(self.vector - other.vector) / self.parameters.like_a_mm))


@dataclass(frozen=True, slots=True, eq=False)
class GeometryBatch(_Numbers):
    """One geometry for each of n poses, for batched computations; ``vector`` is (n, P)."""

    parameters: ParameterSet
    vector: Array
    _arrays: dict[str, Array] = field(default_factory=dict, init=False, repr=False)

    def subset(self, rows: NDArray[np.intp]) -> GeometryBatch:
        """The geometries of some poses."""
        return GeometryBatch(self.parameters, self.vector[rows])


Geometries = Geometry | GeometryBatch
"""One geometry for all poses, or one for each."""

GeometriesType = TypeVar("GeometriesType", bound=_Numbers)
