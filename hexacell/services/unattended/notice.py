"""The notice of a run that nobody watched: of its end, or of the failure that ended it."""

import socket
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from typing import Any, Literal

from hexacell.cell.fields import Frozen, Name, Shown, Text
from hexacell.cell.loader import Cell
from hexacell.cell.operation import Occasion
from hexacell.errors import AnswerNeeded, DeviceError, ExitCode, HexacellError
from hexacell.services.history.cell_status import next_calibration_due
from hexacell.services.history.past_runs import past_runs
from hexacell.services.run.calibration_run import RunRequest
from hexacell.verdict.decision import Verdict
from procedures.run.state import RunState
from procedures.steps import events


class Notice(Frozen):
    """One run, as a notice reports it, without secrets; lengths in mm.

    Attributes:
        version: of this document; keys are only added within one.
        id: equal for every notice of one end of one run, so that a recipient recognises a repetition.
        host: the computer that the cell is run from.
        run: the name of the run folder; None where none began.
        at: when the run ended, UTC.
        line: everything in one line.
        changed_leg: the leg that an alarm names.
        due_at: when the next calibration is due, where the cell file says how long one is valid.
    """

    version: Literal[1] = 1
    id: str
    cell: Name
    host: Shown
    run: Shown | None
    mode: Shown
    at: datetime
    occasions: tuple[Occasion, ...]
    exit_code: int
    line: Shown
    verdict: Verdict | None = None
    position_mm: float | None = None
    expanded_mm: float | None = None
    limit_mm: float | None = None
    changed_leg: int | None = None
    due_at: datetime | None = None

    @property
    def title(self) -> Text:
        """A subject for mail and chat."""
        return f"hexacell: {self.cell}: {', '.join(self.occasions)}"


class PendingNotice(Frozen):
    """A notice, and the name of the recipient who does not have it yet."""

    to: Name
    notice: Notice


class NoticeUndelivered(DeviceError):
    """A recipient did not take a notice; the message has no secret."""


def notice_id(*parts: str) -> str:
    """An id that follows from the words of a notice: equal words, equal id."""
    return sha256("\0".join(parts).encode()).hexdigest()[:32]


TEST_LINE = "a test: notifications of this cell arrive here"


@dataclass(frozen=True, slots=True)
class RunEnd:
    """How a run ended that could be carried out to its end."""

    request: RunRequest
    ended: events.Ended
    state: RunState


def notice_of_end(end: RunEnd) -> Notice:
    """The notice of a run with a verdict, or with a question that nobody answered."""
    cell, state, name = end.request.cell, end.state, end.request.folder.path.name
    accuracy, alarm, occasions = state.accuracy, state.alarm, _occasions(end)
    return _notice(
        cell,
        occasions,
        end.ended.line,
        (name, *occasions),
        run=name,
        mode=end.request.mode.value,
        exit_code=end.ended.exit_code,
        verdict=state.verdict,
        position_mm=None if accuracy is None else accuracy.position.value,
        expanded_mm=None if accuracy is None else accuracy.position.expanded,
        limit_mm=None if accuracy is None else accuracy.position.limit,
        changed_leg=None if alarm is None else alarm.leg,
        due_at=_due_at(cell),
    )


def notice_of_failure(request: RunRequest, error: Exception) -> Notice:
    """The notice of a run that did not begin, or did not come to its end."""
    if isinstance(error, HexacellError):
        text, code = " ".join(str(error).split()), error.exit_code
    else:  # the text of a fault is for its report alone
        text, code = f"a fault of the program: {type(error).__name__}", ExitCode.FAULT
    occasion = Occasion.ANSWER_NEEDED if isinstance(error, AnswerNeeded) else Occasion.FAILURE
    return _notice(
        request.cell,
        (occasion,),
        text,
        (occasion, text, datetime.now(UTC).date().isoformat()),  # tried again, it is the same failure
        run=request.folder.path.name if request.folder.journal.is_file() else None,
        mode=request.mode.value,
        exit_code=int(code),
    )


def notice_of_test(cell: Cell) -> Notice:
    """The notice that shows whether everybody can be notified."""
    own = (Occasion.TEST, datetime.now(UTC).isoformat())
    return _notice(cell, (Occasion.TEST,), TEST_LINE, own, run=None, mode=Occasion.TEST, exit_code=0)


def _notice(
    cell: Cell,
    occasions: tuple[Occasion, ...],
    line: str,
    own: Iterable[str],
    **further: Any,  # noqa: ANN401 - fields of the notice
) -> Notice:
    """A notice from this computer at this moment; ``own`` are the words that its id follows from."""
    name = cell.settings.name
    return Notice(
        id=notice_id(name, *own),
        cell=name,
        host=socket.gethostname(),
        at=datetime.now(UTC),
        occasions=occasions,
        line=f"{name}: {line}",
        **further,
    )


def _occasions(end: RunEnd) -> tuple[Occasion, ...]:
    verdict, code = end.state.verdict, end.ended.exit_code
    found = {
        Occasion.PASS: verdict is Verdict.PASS and code == ExitCode.DONE,
        Occasion.NO_PASS: verdict not in {None, Verdict.PASS},
        Occasion.ALARM: end.state.alarm is not None,
        Occasion.ANSWER_NEEDED: code == ExitCode.ANSWER_NEEDED,
    }
    return tuple(one for one, is_so in found.items() if is_so) or (Occasion.FAILURE,)


def _due_at(cell: Cell) -> datetime | None:
    """When the next calibration is due; None where the config or the runs cannot be read."""
    if cell.settings.acceptance.valid_days is None:
        return None
    try:
        in_force = next((run for run in past_runs(cell) if run.is_in_controller), None)
    except HexacellError:
        return None
    return next_calibration_due(cell, in_force)
