"""The end of a run: its last event, and the exit code of an error."""

from __future__ import annotations

from hexacell.acceptance.validation import Verdict
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
        line += "; rolled back, the controller is as it was"
    return events.Ended(exit_code=int(code), line=line)


def exit_code(error: BaseException) -> ExitCode:
    """The code to leave with; an error of the program itself counts as no result."""
    if isinstance(error, SeveralErrors):
        return error.worst
    if isinstance(error, HexacellError):
        return error.exit_code
    return ExitCode.OUT_OF_LIMITS if isinstance(error, Exception) else ExitCode.INTERRUPTED
