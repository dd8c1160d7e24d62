"""The geometric parameters of a mechanism: kinds, names, units, order.

A mechanism describes its parameters once, as a :class:`ParameterSet`. Vectors, documents, tables, the
prior and the frame convention are derived from that description.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexacell.kinematics.rotations import Array

CONSTRAINTS = 6
"""Of every mechanism: as many as a pose has coordinates."""

LEGS = CONSTRAINTS
"""Of a mechanism whose constraints are all those of driven legs."""

Owners = tuple[tuple[int, ...], ...]
"""For each row of a kind the constraints, counted from 0, that depend on it."""


def each_of(legs: int) -> Owners:
    """A row for each leg, on which that leg alone depends."""
    return tuple((leg,) for leg in range(legs))


OF_SIX = each_of(CONSTRAINTS)


class ParameterUnit(StrEnum):
    """The unit of a parameter, inside the program and in every file."""

    MM = "mm"
    RAD = "rad"
    DEG = "deg"
    NONE = ""

    @property
    def decimals(self) -> int:
        """Decimals in a config: 1 nm; 1 nrad, which is 1 nm at 1 m, or less."""
        return {ParameterUnit.MM: 6, ParameterUnit.DEG: 7}.get(self, 9)

    @property
    def like_a_mm(self) -> float:
        """What counts as much as a millimetre: a milliradian moves by that at 1 m."""
        return {ParameterUnit.MM: 1.0, ParameterUnit.DEG: float(np.degrees(1e-3))}.get(self, 1e-3)

    @property
    def shown(self) -> str:
        """The name of that in text."""
        return {ParameterUnit.MM: "mm", ParameterUnit.NONE: "1e-3"}.get(self, "mrad")


class JointUnit(StrEnum):
    """The unit of a mechanism's joint variables, from the encoders to the constraints and in every file.

    Nothing converts them on the way: of joints that turn, the mechanism's own file alone knows radians.
    """

    MM = "mm"
    DEG = "deg"

    @property
    def thousandth(self) -> str:
        """The name of its thousandth part, in which noise and repeatability are shown."""
        return "um" if self is JointUnit.MM else "mdeg"


class MachinePart(StrEnum):
    """The part of the machine that a length is measured on."""

    BASE = "base"
    PLATFORM = "platform"
    LEGS = "legs"


@dataclass(frozen=True, slots=True)
class ParameterKind:
    """One quantity that every leg has, such as the joint on its slider, or that some of them share.

    Attributes:
        symbol: as in formulas and files: ``S``.
        components: names of its coordinates; empty for a single number.
        meaning: what it is, for the cell file's description.
        tolerance_meaning: what a tolerance of this kind applies to.
        display: name in text, a format of ``legs`` ("B2/B3"), ``leg`` ("2") and ``component`` ("z").
        has_ball_offset: the ball's mounting displaces this kind of all legs by the same vector.
        is_positive: only values above zero are physical.
        default_tolerance: where the cell file states none; without one it must.
        default: its value where a drawing states none; without one it must.
        owners: the legs that depend on each row of it; constraints of passive joints follow the legs.
        part: the part that expands with the temperature, and this kind with it; None if it does not.

    Raises:
        ValueError: the ball's offset needs the components x, y and z, a default none.
    """

    symbol: str
    components: tuple[str, ...]
    meaning: str
    tolerance_meaning: str
    display: str = "{legs} {component}"
    unit: ParameterUnit = ParameterUnit.MM
    has_ball_offset: bool = False
    is_positive: bool = False
    default_tolerance: float | None = None
    part: MachinePart | None = None
    default: float | None = None
    owners: Owners = OF_SIX

    def __post_init__(self) -> None:
        if self.default is not None and self.components:
            raise ValueError(f"{self.symbol} has a default, so it must be a single number a leg")
        if self.has_ball_offset and self.components not in {("x", "y", "z"), ("x", "y")}:
            raise ValueError(
                f"{self.symbol} takes the ball's offset, so its components must be x, y, z or x, y"
            )

    @property
    def shape(self) -> tuple[int, ...]:
        """``(rows, c)``, or ``(rows,)`` for single numbers; a row is of a leg, unless some share it."""
        rows = len(self.owners)
        return (rows, len(self.components)) if self.components else (rows,)

    @property
    def numbers_per_row(self) -> int:
        """How many numbers a row has."""
        return max(1, len(self.components))

    @property
    def size(self) -> int:
        """How many numbers there are of this kind."""
        return len(self.owners) * self.numbers_per_row

    def display_name(self, leg: int, component: str, joints: str | None = None) -> str:
        """The name in text: "leg 3 length", "B6 x"; ``joints`` names several equal parameters."""
        joints = joints or f"{self.symbol}{leg}"
        return self.display.format(legs=joints, leg=leg, component=component).strip()

    @property
    def tolerance_key(self) -> str:
        """Its tolerance in the cell file: ``S_mm``."""
        return f"{self.symbol}_{self.unit}" if self.unit else self.symbol


@dataclass(frozen=True, slots=True)
class GeometricParameter:
    """One number of the geometry; ``leg``, from 1, is its row of the kind."""

    kind: ParameterKind
    leg: int
    component: str = ""

    @property
    def name(self) -> str:
        """``S3x``, ``l4``."""
        return f"{self.kind.symbol}{self.leg}{self.component}"


@dataclass(frozen=True)
class ParameterSet:
    """All parameters of a mechanism, in the order of its vectors: by kind, then row, then component.

    ``has_branch``: a leg has two inverse solutions, and a config states beside the parameters which one.
    """

    kinds: tuple[ParameterKind, ...]
    has_branch: bool = True

    @cached_property
    def parameters(self) -> tuple[GeometricParameter, ...]:
        """Every parameter, in order."""
        return tuple(
            GeometricParameter(kind, leg, component)
            for kind in self.kinds
            for leg in range(1, len(kind.owners) + 1)
            for component in (kind.components or ("",))
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Every parameter's name, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def rows(self, names: Iterable[str]) -> NDArray[np.intp]:
        """Indices of parameters in a vector."""
        index = {name: row for row, name in enumerate(self.names)}
        return np.array([index[name] for name in names], dtype=np.intp)

    @cached_property
    def slices(self) -> Mapping[str, slice]:
        """The part of a vector that belongs to each kind, by its symbol."""
        ends = np.cumsum([kind.size for kind in self.kinds]).tolist()
        symbols = (kind.symbol for kind in self.kinds)
        return {
            symbol: slice(begin, end)
            for symbol, begin, end in zip(symbols, [0, *ends[:-1]], ends, strict=True)
        }

    @cached_property
    def shapes(self) -> Mapping[str, tuple[int, ...]]:
        """The shape of each kind's values, by its symbol."""
        return {kind.symbol: kind.shape for kind in self.kinds}

    @property
    def legs(self) -> int:
        """How many rows the kind with most of them has: one for each driven leg."""
        return max(len(kind.owners) for kind in self.kinds)

    @cached_property
    def columns(self) -> int:
        """How many parameters the constraint has that depends on most of them."""
        return max(sum(kind.numbers_per_row for kind in self._of(row)) for row in range(CONSTRAINTS))

    @cached_property
    def like_a_mm(self) -> Array:
        """What counts as much as a millimetre of each parameter (P,)."""
        return np.array([parameter.kind.unit.like_a_mm for parameter in self.parameters])

    @cached_property
    def places(self) -> tuple[tuple[int, int], ...]:
        """The parameters, and where each constraint that depends on one has its derivative.

        In all constraints' derivatives (6, c) as one row, each constraint's in the order of the kinds.
        """
        found: list[tuple[int, int]] = []
        for constraint in range(CONSTRAINTS):
            place = constraint * self.columns
            for kind in self._of(constraint):
                row = next(n for n, owners in enumerate(kind.owners) if constraint in owners)
                first = self.slices[kind.symbol].start + row * kind.numbers_per_row
                found += [(first + number, place + number) for number in range(kind.numbers_per_row)]
                place += kind.numbers_per_row
        return tuple(sorted(found))

    @cached_property
    def first_places(self) -> NDArray[np.intp]:
        """For each parameter the first of its :attr:`places`."""
        first = dict(reversed(self.places))
        return np.array([first[row] for row in range(len(self))], dtype=np.intp)

    def by_constraint(self, changes: Array) -> Array:
        """Changes (P, ...) of the parameters as those (6, c, ...) of what each constraint depends on."""
        rows, places = np.array(self.places).T
        found = np.zeros((CONSTRAINTS * self.columns, *changes.shape[1:]))
        found[places] = changes[rows]
        return found.reshape(CONSTRAINTS, self.columns, *changes.shape[1:])

    def _of(self, constraint: int) -> Iterator[ParameterKind]:
        """The kinds that a constraint depends on."""
        return (kind for kind in self.kinds if any(constraint in owners for owners in kind.owners))

    def of_every_row(self, values: Array) -> Array:
        """The vector in which all rows of a kind have the same numbers: values (c,), kind by kind."""
        ends = np.cumsum([kind.numbers_per_row for kind in self.kinds])[:-1]
        parts = zip(self.kinds, np.split(values, ends), strict=True)
        return np.concatenate([np.tile(part, len(kind.owners)) for kind, part in parts])

    def by_kind(self, values: Mapping[str, float]) -> Array:
        """The vector in which all parameters of a kind have the value under its symbol."""
        counts = [kind.size for kind in self.kinds]
        return np.repeat([values[kind.symbol] for kind in self.kinds], counts)

    @cached_property
    def ball_offset(self) -> Array:
        """The change (3, P) of the parameters when the ball is displaced by 1 mm in x, y or z."""
        names = "xyz"
        return np.array(
            [[p.kind.has_ball_offset and p.component == axis for p in self.parameters] for axis in names],
            dtype=float,
        )

    def array(self, vector: Array, symbol: str) -> Array:
        """One kind's values ``(..., rows, c)`` or ``(..., rows)`` in vectors (..., P): a view."""
        return vector[..., self.slices[symbol]].reshape(*vector.shape[:-1], *self.shapes[symbol])

    def changes(self, symbol: str, values: Array) -> Array:
        """Changes (P, k) of all parameters by those (rows, c, k) or (rows, k) of one kind alone."""
        changes = np.zeros((len(self), values.shape[-1]))
        changes[self.slices[symbol]] = values.reshape(-1, values.shape[-1])
        return changes

    def vector(self, values: Mapping[str, ArrayLike]) -> Array:
        """The vector (P,) of the values under each kind's symbol.

        Raises:
            ValueError: a kind has a wrong shape.
        """
        arrays = []
        for symbol, shape in self.shapes.items():
            array = np.asarray(values[symbol], dtype=float)
            if array.shape != shape:
                raise ValueError(f"{symbol} has the shape {array.shape}, not {shape}")
            arrays.append(array.ravel())
        return np.concatenate(arrays)

    def document(self, vector: Array) -> dict[str, Any]:
        """The vector as nested lists under the symbols of its kinds, the form of every file."""
        return {symbol: self.array(vector, symbol).tolist() for symbol in self.shapes}
