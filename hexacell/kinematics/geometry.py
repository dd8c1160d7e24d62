"""The geometry of a robot: one number for each parameter of its mechanism."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
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

    def document(self) -> dict[str, Any]:
        """Nested lists under the symbols of the kinds, the form of every file."""
        return self.parameters.document(self.vector)

    def largest_difference(self, other: Geometry) -> float:
        """Largest absolute difference of a parameter, mm; mrad of an angle."""
        return float(np.max(np.abs(self.vector - other.vector) / self.parameters.like_a_mm))

    def interpolate(self, other: Geometry, fraction: float) -> Geometry:
        """Linear interpolation: 0 gives this geometry, 1 gives ``other``."""
        return Geometry(self.parameters, (1.0 - fraction) * self.vector + fraction * other.vector)


@dataclass(frozen=True, slots=True, eq=False)
class GeometryBatch:
    """One geometry for each of n poses, for batched computations; ``vectors`` are (n, P)."""

    parameters: ParameterSet
    vectors: Array
    _arrays: dict[str, Array] = field(default_factory=dict, init=False, repr=False)

    def __getitem__(self, symbol: str) -> Array:
        if symbol not in self._arrays:
            self._arrays[symbol] = self.parameters.array(self.vectors, symbol)
        return self._arrays[symbol]

    def once(self, name: str, compute: Callable[[], Array]) -> Array:
        """What follows from the geometry alone, under a name that is no symbol: computed once."""
        if name not in self._arrays:
            self._arrays[name] = compute()
        return self._arrays[name]

    def interpolate_from(self, start: Geometry, fraction: float) -> GeometryBatch:
        """Linear interpolation from one geometry: 0 gives ``start`` for each pose, 1 gives this batch."""
        return GeometryBatch(self.parameters, (1.0 - fraction) * start.vector + fraction * self.vectors)

    def subset(self, rows: NDArray[np.intp]) -> GeometryBatch:
        """The geometries of some poses."""
        return GeometryBatch(self.parameters, self.vectors[rows])
