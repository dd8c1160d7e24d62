"""Messages on the wire: every kind of event, question and command arrives as it was sent."""

from datetime import datetime
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from hexacell.errors import UsageError
from hexacell.run_process import messages
from hexacell.run_process.live_snapshot import GaugeSnapshot, LiveSnapshot
from procedures.engine.command_loop import Status
from procedures.engine.commands import Command, Undo
from procedures.run.questions import Question
from procedures.steps import events
from tests.complete_models import complete

NOON = TypeAdapter(datetime).validate_json('"2026-11-20T12:00:00.123Z"')
EVENTS: tuple[Any, ...] = get_args(get_args(events.Event)[0])
COMMANDS: tuple[Any, ...] = get_args(Command)
SUBJECTS: tuple[Any, ...] = get_args(get_type_hints(Question)["subject"])
SAME_EACH_TIME = settings(
    max_examples=6,
    deadline=None,
    database=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)


@st.composite
def valid(draw: st.DrawFn, kind: type[Any]) -> Any:
    """An instance of a record; hypothesis knows nothing of what its validators refuse."""
    complete()
    try:
        return draw(st.from_type(kind))
    except ValidationError:
        return reject()


def told(message: messages.HostMessage) -> str:
    """A message as text: a number that is none is not equal to itself. ``fold`` says nothing in UTC."""
    return repr(message).replace(", fold=1", "")


def from_host(sent: messages.HostMessage) -> messages.HostMessage:
    """What arrives of a message; it is one line."""
    line = messages.message_line(sent)
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 1
    return messages.host_message(line)


@pytest.mark.parametrize("kind", EVENTS, ids=lambda kind: kind.__name__)
def test_every_event_arrives_as_it_was_sent(kind):
    @SAME_EACH_TIME
    @given(valid(kind))
    def arrives(event: Any) -> None:
        sent = messages.EventRecorded(sequence=3, at=NOON, event=event)
        assert told(from_host(sent)) == told(sent)

    arrives()


@pytest.mark.parametrize("kind", COMMANDS, ids=lambda kind: kind.__name__)
def test_every_command_arrives_as_it_was_given(kind):
    @SAME_EACH_TIME
    @given(valid(kind))
    def arrives(command: Any) -> None:
        received = messages.client_message(messages.message_line(messages.GiveCommand(command=command)))
        assert isinstance(received, messages.GiveCommand)
        assert type(received.command) is kind
        assert received.command == command

    arrives()


def test_every_question_arrives_as_it_was_asked() -> None:
    subjects = set()

    @settings(SAME_EACH_TIME, max_examples=100)
    @given(valid(Question))
    def arrives(question: Question) -> None:
        sent = messages.QuestionChanged(question=question)
        subjects.add(type(question.subject))
        assert told(from_host(sent)) == told(sent)

    arrives()
    assert subjects == set(SUBJECTS)


def test_every_kind_has_a_word_of_its_own() -> None:
    for union in (messages.HostMessage, messages.ClientMessage):
        words = [get_args(one.model_fields["kind"].annotation)[0] for one in get_args(get_args(union)[0])]
        assert len(set(words)) == len(words)


@pytest.mark.parametrize(
    "sent",
    [
        messages.HostFailed(problem="one\ntwo\u2028three\r", action="", exit_code=3),
        messages.RunDescribed(
            cell="c", cell_file=Path("/a/cell.toml"), folder=Path("/a/run"), mode="check"
        ),
        messages.ControlChanged(is_in_control=True, who="ada"),
        messages.StatusChanged(status=Status.PAUSED),
        LiveSnapshot(gauges=(GaugeSnapshot(name="x", axis="x", shown_mm=-0.1, travel_mm=12.5),)),
        messages.QuestionChanged(question=None),
        messages.CursorMoved(sequence=1, last=2, at=NOON, speed=0.5),
    ],
    ids=lambda sent: sent.kind,
)
def test_every_other_message_arrives_as_one_line(sent: messages.HostMessage) -> None:
    assert from_host(sent) == sent


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"not json\n",
        b'{"kind":"command","command":{"name":"Explode"}}\n',
        b'{"kind":"command","command":{"name":"Pause","at_once":"perhaps"}}\n',
        b'{"kind":"command","command":"Pause"}\n',
        b'{"kind":"leave","keep_running":true,"more":1}\n',
        b'{"kind":"event"}\n',
    ],
)
def test_what_is_no_message_is_refused(line: bytes) -> None:
    with pytest.raises(UsageError, match="is not understood"):
        messages.client_message(line)
    with pytest.raises(UsageError, match="is not understood"):
        messages.host_message(messages.message_line(messages.GiveCommand(command=Undo())))
