"""What a screen knows of a run: a fold over the messages of its host, and the first line that shows it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime

from hexacell.campaign.decisions import Forecast
from hexacell.errors import ExitCode
from hexacell.run_process import messages
from hexacell.run_process.live_snapshot import LiveSnapshot
from procedures.engine.command_loop import Status
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import Question
from procedures.run.state import RunState, apply
from procedures.steps import events
from procedures.steps.events import Step
from procedures.steps.move import Expectation, Move

Setback = events.Tripped | events.Failed | events.Interrupted | messages.HostFailed
"""What a fault is shown from."""


MODES = {"optimise": "calibration", "quick": "quick level", "check": "check", "length": "length check"}


@dataclass(frozen=True, slots=True)
class RunPicture:
    """A run as a screen sees it.

    Attributes:
        live: what the devices showed last, and ``live_at_s`` when that came, by the screen's clock.
        step: the step that was begun last; None between steps.
        expected: predicted readings of the gauges, by set and orientation.
        forecasts: predicted errors, each with the number of records for the identification before it.
        setback: the latest fault, until a step is begun after it; ``setbacks`` is the number of faults.
        refusal: the command that was refused last; ``refusals`` is how many were.
        record_times: when records were taken, for the time that is left.
    """

    described: messages.RunDescribed | None = None
    state: RunState = field(default_factory=RunState)
    status: Status = Status.IDLE
    question: Question | None = None
    live: LiveSnapshot | None = None
    live_at_s: float = 0.0
    control: messages.ControlChanged | None = None
    cursor: messages.CursorMoved | None = None
    step: Step | None = None
    last: events.Event | None = None
    expected: Mapping[tuple[SetKey, int], Expectation] = field(default_factory=dict)
    forecasts: tuple[tuple[int, Forecast], ...] = ()
    setback: Setback | None = None
    setbacks: int = 0
    refusal: events.CommandRejected | None = None
    refusals: int = 0
    record_times: tuple[datetime, ...] = ()

    @property
    def is_recorded(self) -> bool:
        """Whether this is a recorded run, which is watched again."""
        return self.described is not None and self.described.is_recorded

    @property
    def may_command(self) -> bool:
        """Whether commands of this screen are taken."""
        return not self.is_recorded and (self.control is None or self.control.is_in_control)

    @property
    def why_not_written(self) -> str:
        """Why a run ended without its result in the config: a person, or a gate; empty if it did not so."""
        is_waiting = self.state.proposed is not None and self.state.committed is None
        if is_waiting and isinstance(self.setback, events.Interrupted):
            return self.setback.reason if self.setback.exit_code == ExitCode.OUT_OF_LIMITS else ""
        return ""

    @property
    def at(self) -> SetKey | None:
        """The set that is being measured."""
        if (step_at := getattr(self.step, "at", None)) is not None:
            return SetKey.model_validate(step_at)
        return self.state.at_pose[0] if self.state.at_pose else None


def picture_after(  # noqa: PLR0911 - a case a message
    picture: RunPicture, message: messages.HostMessage, now_s: float
) -> RunPicture:
    """The picture after one more message, which came at ``now_s`` by the screen's clock."""
    match message:
        case messages.RunDescribed():
            return RunPicture(described=message, control=picture.control)
        case messages.EventRecorded():
            return _with_event(picture, message)
        case messages.StatusChanged(status=status):
            return replace(picture, status=status)
        case messages.QuestionChanged(question=question):
            return replace(picture, question=question)
        case LiveSnapshot():
            return replace(picture, live=message, live_at_s=now_s)
        case messages.ControlChanged():
            return replace(picture, control=message)
        case messages.CursorMoved():
            return replace(picture, cursor=message)
        case messages.HostFailed():
            # The journal has already said how a run ended.
            is_known = isinstance(picture.setback, events.Interrupted) and message.exit_code is not None
            return picture if is_known else _with_setback(picture, message)


def _with_event(picture: RunPicture, message: messages.EventRecorded) -> RunPicture:
    event = message.event
    picture = replace(picture, state=apply(picture.state, event), last=event)
    match event:
        case events.StepBegun(step=step):
            picture = replace(picture, step=step, setback=None)
            if not isinstance(step, Move) or (expected := step.expected) is None:
                return picture
            records, forecast = len(picture.state.samples(Phase.IDENTIFY)), expected.forecast
            earlier = tuple(one for one in picture.forecasts if one[0] < records)  # others were discarded
            return replace(
                picture,
                expected={**picture.expected, (step.at, step.orientation): expected},
                forecasts=(*earlier, *([] if forecast is None else [(records, forecast)])),
            )
        case events.RecordTaken():
            return replace(picture, record_times=(*picture.record_times, message.at), step=None)
        case events.CommandRejected():
            return replace(picture, refusal=event, refusals=picture.refusals + 1)
        case events.Tripped() | events.Failed() | events.Interrupted():
            return replace(_with_setback(picture, event), step=None)
        case _:
            return picture


def _with_setback(picture: RunPicture, setback: Setback) -> RunPicture:
    return replace(picture, setback=setback, setbacks=picture.setbacks + 1)


def header_line(cell: str, picture: RunPicture) -> tuple[str, str]:
    """The cell and what is done there; and who is in control, or where a recorded run stands."""
    described, control = picture.described, picture.control
    if described is None:
        return f"hexacell │ {cell}", ""
    activity = MODES[described.mode]
    if described.is_recorded:
        where = f"hexacell │ {cell} │ recorded {activity} {described.folder.name}"
        if (cursor := picture.cursor) is None:
            return where, ""
        speed = f"x{cursor.speed:g}" if cursor.speed else "halted"
        return where, f"{cursor.at:%Y-%m-%d %H:%M:%S} {cursor.sequence}/{cursor.last} {speed}"
    who = ""
    if picture.status is Status.ENDED:
        who = "over"
    elif control is not None:
        watching = f"watching, {control.who or 'nobody'} is in control"
        who = "you are in control" if control.is_in_control else watching
    return f"hexacell │ {cell} │ {activity}", who


WORDS = {"MeasureAgain": "Measuring again", "Undo": "Taking back the last record", "Pause": "Pausing"}
"""What a refused command would have done, by its name in the journal."""


def refusal_text(refusal: events.CommandRejected) -> str:
    """Why something that was asked for is not done."""
    return f"{WORDS.get(refusal.command, refusal.command)} is not possible now: {refusal.reason}"
