"""The messages of the adapter protocol: answers are checked as if a stranger had sent them."""

import json
from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, SecretStr, ValidationError

from hexacell.cell.fields import SixInRange, first_mistake
from hexacell.storage.toml_document import MASK, is_secret

VERSION = 1

LONGEST_LINE = 65_536
"""Bytes of a message, its line end included."""

LONGEST_TEXT = 2_000
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]


class FailureKind(StrEnum):
    """Why a request failed."""

    POSE = "pose"
    REFUSED = "refused"
    INTERRUPTED = "interrupted"
    FAULT = "fault"


class Answer(BaseModel):
    """A part of an answer; keys that a later version may add are left out."""

    model_config = ConfigDict(strict=True, frozen=True, extra="ignore", defer_build=True)


class Hello(Answer):
    """Who the program and its controller are, and in which units they speak."""

    version: Literal[1]
    length: Literal["mm"]
    angle: Literal["deg"]
    name: Text
    description: Text = ""
    serial_number: Text = ""


class Status(Answer):
    """What the controller is ready for; ``remote`` is whether it takes commands from here."""

    estop: bool
    enabled: bool
    homed: bool
    remote: bool
    moving: bool
    errors: Annotated[tuple[Text, ...], Field(max_length=100)] = ()
    heartbeat: Text = ""


class Position(Answer):
    """Pose, mm and deg, and joints, mm or deg; None where they are not known."""

    pose: SixInRange | None
    joints: SixInRange | None = None


class Failure(Answer):
    """Why a request failed; ``axis`` is whose limit a pose is beyond, at its ``highest`` or lowest end."""

    kind: FailureKind = Field(strict=False)
    reason: Annotated[str, Field(min_length=1, max_length=LONGEST_TEXT)]
    action: Text | None = None
    axis: Literal["x", "y", "z", "a", "b", "c"] | None = None
    highest: bool = True


class Nothing(Answer):
    """What needs no words: it is done."""


class Line(Answer):
    """One line from a program: exactly one of ``at``, ``done`` and ``failed``."""

    id: int
    at: SixInRange | None = None
    done: dict[str, Any] | None = None
    failed: Failure | None = None


AnswerType = TypeVar("AnswerType", bound=Answer)


class UnknownAnswer(Exception):
    """A line or an answer that is not of the protocol; the text says what is wrong with it."""


def read_line(line: bytes) -> Line:
    """The message in a line.

    Raises:
        UnknownAnswer: it is none, or has not exactly one of its parts.
    """
    found = checked(Line, line)
    if sum(part is not None for part in (found.at, found.done, found.failed)) != 1:
        raise UnknownAnswer("a message has one of at, done and failed")
    return found


def checked(wanted: type[AnswerType], given: bytes | Mapping[str, Any]) -> AnswerType:
    """The answer in a line, or in its ``done``.

    Raises:
        UnknownAnswer: it is none.
    """
    text = given if isinstance(given, bytes) else json.dumps(given)
    try:
        return wanted.model_validate_json(text)
    except ValidationError as error:
        raise UnknownAnswer(first_mistake(error, "a line")) from error


def request_line(number: int, do: str, fields: Mapping[str, Any], *, is_shown: bool = False) -> bytes:
    """The line of a request; ``is_shown``: as a trace has it, without secrets."""
    request = {"id": number, "do": do, **fields}
    settings = request.get("settings")
    if is_shown and settings:
        request["settings"] = {key: MASK if is_secret((key,)) else one for key, one in settings.items()}

    def told(secret: object) -> str:
        return secret.get_secret_value() if isinstance(secret, SecretStr) and not is_shown else MASK

    return json.dumps(request, default=told, allow_nan=False).encode() + b"\n"
