"""The answers of a program that serves a controller, checked for their form: finite, complete, small."""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from hexacell.cell.fields import LONGEST_TEXT, InRange
from hexacell.printable import printable

LONGEST_LINE = 65_536
"""Longest message, bytes."""
MOST_ERRORS = 10

Coordinates = Annotated[list[InRange], Field(min_length=4, max_length=6)]
Told = Annotated[str, AfterValidator(lambda text: printable(text[:LONGEST_TEXT]))]
"""A text of the program, in one printable piece."""


class Message(BaseModel):
    """A part of an answer; what this version does not know of it is ignored."""

    model_config = ConfigDict(strict=True, frozen=True)


class Nothing(Message):
    """The answer that it is done."""


class Hello(Message):
    """Who answers, and in which units."""

    version: int
    length: Told
    angle: Told
    name: Told
    description: Told = ""
    serial_number: Told = ""


class Status(Message):
    """The state of the controller."""

    estop: bool
    enabled: bool
    homed: bool
    remote: bool
    moving: bool
    errors: Annotated[list[Told], AfterValidator(lambda texts: texts[-MOST_ERRORS:])] = []
    heartbeat: Told = ""


class Position(Message):
    """Where the robot is, as far as it is known."""

    pose: Coordinates | None
    joints: Coordinates | None = None


class Failed(Message):
    """A request that failed."""

    kind: Literal["pose", "refused", "interrupted", "fault"]
    reason: Told
    action: Told | None = None
    axis: Literal["x", "y", "z", "a", "b", "c"] | None = None
    highest: bool = True


class Answer(Message):
    """One line: on the way, done, or failed."""

    model_config = ConfigDict(extra="forbid")

    id: int
    at: Coordinates | None = None
    done: dict[str, Any] | None = None
    failed: Failed | None = None

    @model_validator(mode="after")
    def _is_one(self) -> Self:
        if len(self.model_fields_set) != 2 or (self.at, self.done, self.failed) == (None,) * 3:
            raise ValueError("it is not one of at, done and failed")
        return self
