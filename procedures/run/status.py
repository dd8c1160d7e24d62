"""The status of the engine, the last event of a run, and the exit code of an error."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from hexacell.acceptance import Verdict
from hexacell.errors import ExitCode, HexacellError, SeveralErrors
from procedures.run import events
from procedures.run.state import RunState


def ending(state: RunState) -> events.Ended:
    """The last event of a run with nothing left to do."""
    if state.ended is not None:
        return state.ended
    judged = state.judged
    passed = judged is not None and judged.verdict is Verdict.PASS
    code = ExitCode.DONE if passed else ExitCode.OUT_OF_LIMITS
    line = judged.line if judged is not None else "nothing was judged"
    if state.rolled_back:
        line += "; rolled back, the controller has its old config"
    return events.Ended(exit_code=int(code), line=line)


def exit_code(error: BaseException) -> ExitCode:
    """The code to leave with; an error of the program itself counts as no result."""
    if isinstance(error, SeveralErrors):
        return error.worst
    if isinstance(error, HexacellError):
        return error.exit_code
    return ExitCode.OUT_OF_LIMITS if isinstance(error, Exception) else ExitCode.INTERRUPTED


class Status(StrEnum):
    """What an engine is doing, for screens."""

    IDLE = "idle"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    AWAITING_OPERATOR = "awaiting operator"
    STOPPING = "stopping"
    ENDED = "ended"
    FAULTED = "faulted"


@dataclass(frozen=True, slots=True)
class EngineFlags:
    """Facts about the engine; several may hold at once.

    Attributes:
        fault: what failed, until somebody decides how to continue.
        asking: a question waits for a person.
        pausing: a pause is wanted, ``at_once`` in mid-step; ``paused``: it has begun.
        stopping: why the run is to end; nothing where it is not.
    """

    begun: bool = False
    ended: bool = False
    fault: str | None = None
    asking: bool = False
    pausing: bool = False
    at_once: bool = False
    paused: bool = False
    stopping: str | None = None

    @property
    def status(self) -> Status:
        """The most severe fact decides; a fault stays until it is cleared, also after the end."""
        words = (
            (self.fault is not None, Status.FAULTED),
            (self.ended, Status.ENDED),
            (self.stopping is not None, Status.STOPPING),
            (self.paused, Status.PAUSED),
            (self.asking, Status.AWAITING_OPERATOR),
            (self.pausing, Status.PAUSING),
            (self.begun, Status.RUNNING),
        )
        return next((status for holds, status in words if holds), Status.IDLE)
