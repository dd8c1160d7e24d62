"""An alarm of a check repeats it: one unchanged machine in 100 raises one, which must wake nobody."""

from __future__ import annotations

from dataclasses import replace

from hexacell.checks.change_alarm import ChangeAlarm
from hexacell.runs.run_folder import new_run
from hexacell.services.run.calibration_run import RunRequest
from hexacell.verdict.decision import Verdict
from procedures.calibration.workflow import Mode
from procedures.run.state import RunState


def raised_alarm(state: RunState) -> ChangeAlarm | None:
    """The alarm that a check raised; none if it raised none."""
    check = None if state.judged is None else state.judged.check
    alarm = None if check is None else check.alarm
    return alarm if alarm is not None and alarm.is_raised else None


def repetition(request: RunRequest, state: RunState) -> RunRequest | None:
    """The check to be made once more after one that nobody watched; none where there is no need.

    One that failed is not repeated: it has found what an alarm only suspects.
    """
    is_check = request.unattended and request.mode is Mode.CHECK
    if not is_check or raised_alarm(state) is None:
        return None
    has_failed = state.judged is not None and state.judged.verdict is Verdict.FAIL
    return None if has_failed else replace(request, folder=new_run(request.cell), resume=False)
