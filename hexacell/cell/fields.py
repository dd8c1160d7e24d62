"""Types that the sections of the cell file share, with each other and with the records of a run."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import PydanticCustomError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]
SixNumbers = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class Frozen(BaseModel):
    """A record that is kept in a file; no key is unknown, and NaN and infinity are numbers in JSON too."""

    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="constants")


class Section(Frozen):
    """A section of the cell file."""


class GeometrySettings(Section):
    """One value a parameter of the mechanism, under the symbols of the kinds that the mechanism has."""


def broken_rule(problem: str, action: str) -> PydanticCustomError:
    """The error that a validator raises: the problem and the next action."""
    return PydanticCustomError("broken_rule", "{problem}", {"problem": problem, "action": action})


def first_mistake(refusal: ValidationError, whole: str) -> str:
    """Where the first mistake of a record is, and what it is; ``whole`` names the record itself."""
    first = refusal.errors(include_url=False, include_context=False)[0]
    where = ".".join(str(key) for key in first["loc"]) or whole
    return f"{where}: {first['msg']}"


GeometryDocument = dict[str, tuple[Finite | tuple[Finite, ...], ...]]
"""The values of a geometry under the symbols of its parameter kinds, as JSON files have them."""
