"""Messages between a run and who watches it: JSON, one line each.

The first message to a client is :class:`RunDescribed`; then the whole journal follows as
:class:`EventRecorded`, and each event as it is recorded. A later ``RunDescribed`` begins anew: what was
received before it does not count. So a recorded run goes back in time. Snapshots of the devices are for
screens, never for records.
"""

from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import BeforeValidator, Field, PlainSerializer, TypeAdapter, ValidationError

from hexacell.cell.fields import Frozen, first_mistake
from hexacell.errors import UsageError
from hexacell.run_process.live_snapshot import LiveSnapshot
from procedures.engine.command_loop import Status
from procedures.engine.commands import Command
from procedures.run.questions import Question
from procedures.steps.events import Event

Message = TypeVar("Message")

LONGEST_MESSAGE = 16 << 20
"""Bytes of one line; no message comes near it."""


@cache  # none of these adapters is made before a run is there: each takes a screen some milliseconds
def _commands() -> dict[str, TypeAdapter[Any]]:
    return {command.__name__: TypeAdapter(command) for command in get_args(Command)}


def _command_document(command: Command) -> dict[str, Any]:
    name = type(command).__name__
    fields: dict[str, Any] = _commands()[name].dump_python(command, mode="json")
    return {"name": name, **fields}


def _command_in(value: object) -> object:
    """The command of a document; anything else is left to be refused."""
    if not isinstance(value, dict) or value.get("name") not in _commands():
        return value
    return _commands()[value["name"]].validate_python({k: v for k, v in value.items() if k != "name"})


class RunDescribed(Frozen):
    """Which run this is; what was received before it no longer counts.

    Attributes:
        cell: the name of the cell; ``cell_file`` its file.
        folder: the folder of the run.
        expected_records: how many records and closings of sets are planned.
        is_recorded: whether this is a recorded run, which takes no commands.
    """

    kind: Literal["run"] = "run"
    cell: str
    cell_file: Path
    folder: Path
    mode: Literal["check", "quick", "optimise", "length"]
    expected_records: int = 0
    is_recorded: bool = False


class EventRecorded(Frozen):
    """An event is in the journal: ``sequence`` is its line there, from 1, and ``at`` its time."""

    kind: Literal["event"] = "event"
    sequence: int
    at: datetime
    event: Event


class StatusChanged(Frozen):
    """What the engine does now."""

    kind: Literal["status"] = "status"
    status: Status


class QuestionChanged(Frozen):
    """The question that waits for an :class:`~procedures.engine.commands.Answer`, if any."""

    kind: Literal["question"] = "question"
    question: Question | None


class ControlChanged(Frozen):
    """Whether this client gives the commands now, and who does; ``who`` is empty if nobody does."""

    kind: Literal["control"] = "control"
    is_in_control: bool
    who: str


class CursorMoved(Frozen):
    """A recorded run stands at line ``sequence`` of ``last``, and advances by itself.

    It does so ``speed`` times as fast as it was recorded; 0 is standstill.
    """

    kind: Literal["cursor"] = "cursor"
    sequence: int
    last: int
    at: datetime
    speed: float


class HostFailed(Frozen):
    """The run could not begin or ended early, or a message was refused: why, and what to do next.

    ``exit_code`` is that of the run; None where it goes on. With ``evidence_lost`` it cannot be resumed.
    """

    kind: Literal["failed"] = "failed"
    problem: str
    action: str = ""
    exit_code: int | None = None
    evidence_lost: bool = False


class GiveCommand(Frozen):
    """Give the engine a command; only who is in control may."""

    kind: Literal["command"] = "command"
    command: Annotated[Command, BeforeValidator(_command_in), PlainSerializer(_command_document)]


class TakeControl(Frozen):
    """Give the commands from now on; who did so before watches."""

    kind: Literal["take control"] = "take control"


class Leave(Frozen):
    """Go away; the run goes on without anybody, or is stopped after its step."""

    kind: Literal["leave"] = "leave"
    keep_running: bool


HostMessage = Annotated[
    RunDescribed
    | EventRecorded
    | StatusChanged
    | QuestionChanged
    | LiveSnapshot
    | ControlChanged
    | CursorMoved
    | HostFailed,
    Field(discriminator="kind"),
]
ClientMessage = Annotated[GiveCommand | TakeControl | Leave, Field(discriminator="kind")]


@cache
def _from_host() -> TypeAdapter[HostMessage]:
    return TypeAdapter(HostMessage)


@cache
def _from_client() -> TypeAdapter[ClientMessage]:
    return TypeAdapter(ClientMessage)


def message_line(message: HostMessage | ClientMessage) -> bytes:
    """The line of a message, its line feed included."""
    return message.model_dump_json().encode() + b"\n"


def host_message(line: bytes) -> HostMessage:
    """The message in a line from the host; raises ``UsageError`` if it is not one."""
    return _read(_from_host(), line)


def client_message(line: bytes) -> ClientMessage:
    """The message in a line from a client; raises ``UsageError`` if it is not one."""
    return _read(_from_client(), line)


def _read(known: TypeAdapter[Message], line: bytes) -> Message:
    try:
        return known.validate_json(line)
    except ValidationError as error:
        problem = f"this message is not understood ({first_mistake(error, 'the message')})"
        raise UsageError(problem, action="Use the same version of hexacell on both sides") from error
