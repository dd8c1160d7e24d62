"""The sections of the cell file whose keys the mechanism decides: geometries and tolerances."""

from __future__ import annotations

from functools import cache
from typing import Any, TypeVar

from pydantic import Field, create_model

from hexacell.cell.fields import Finite, NotNegative, Positive, Section
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import ParameterKind, ParameterSet
from hexacell.plugins import Group, load

DEFAULT_MECHANISM = "hexaglide"


@cache
def mechanism_named(name: str) -> Mechanism:
    """The mechanism that is announced under a name.

    Raises:
        UsageError: there is none.
    """
    found: Mechanism = load(Group.MECHANISMS, name)()
    return found


class GeometrySettings(Section):
    """One value a parameter of the mechanism; ``settings["S"]`` are those of a kind, in its unit."""

    def __getitem__(self, symbol: str) -> Any:  # noqa: ANN401 - tuples, nested as the kind's shape says
        return getattr(self, symbol)

    def document(self) -> dict[str, Any]:
        """Nested tuples under the symbols of the kinds."""
        return self.model_dump()


class ToleranceSettings(Section):
    """Largest deviations of the built robot from its drawing; has a key a kind, and ``ball_mm``."""

    def document(self) -> dict[str, float]:
        """The tolerances under their keys."""
        return self.model_dump()


@cache
def geometry_settings(parameters: ParameterSet) -> type[GeometrySettings]:
    """The section for a geometry of these parameters."""
    fields: dict[str, Any] = {
        kind.symbol: (_array_type(kind.shape), Field(description=kind.meaning)) for kind in parameters.kinds
    }
    return _made("GeometrySettings", GeometrySettings, fields)


@cache
def tolerance_settings(parameters: ParameterSet) -> type[ToleranceSettings]:
    """The section for the tolerances of these parameters."""
    fields: dict[str, Any] = {
        kind.tolerance_key: (Positive, _tolerance_field(kind)) for kind in parameters.kinds
    }
    kinds = " and ".join(kind.symbol for kind in parameters.kinds if kind.has_ball_offset)
    description = f"mounting of the ball: an offset common to all {kinds}"
    fields["ball_mm"] = (NotNegative, Field(0.0, description=description))
    return _made("ToleranceSettings", ToleranceSettings, fields)


def _tolerance_field(kind: ParameterKind) -> Any:  # noqa: ANN401 - what pydantic's Field returns
    default = ... if kind.default_tolerance is None else kind.default_tolerance
    return Field(default, description=kind.tolerance_meaning)


def _array_type(shape: tuple[int, ...]) -> Any:  # noqa: ANN401 - a type made here
    made: Any = Finite
    for length in reversed(shape):
        made = tuple.__class_getitem__((made,) * length)
    return made


SectionType = TypeVar("SectionType", bound=Section)


def _made(name: str, base: type[SectionType], fields: dict[str, Any]) -> type[SectionType]:
    made: type[SectionType] = create_model(name, __base__=base, __doc__=base.__doc__, **fields)
    return made
