"""Text for what went wrong: the fact, its cause, and the next action."""

from __future__ import annotations

from hexacell.run_process.messages import HostFailed
from hexacell.text.screens.run_picture import Setback
from hexacell.text.screens.views import FaultView
from procedures.run import events

RESUMABLE = "What was measured is kept. Mend it, then press r in 2 Preflight, which resumes the run."


def fault_view(setback: Setback) -> FaultView:
    """A fault in words."""
    match setback:
        case events.Tripped(guard=guard, device=device, problem=problem, action=action):
            where = f"{device}: " if device else ""
            return FaultView(f"Stopped by a guard: {guard.value}", f"{where}{problem}", action)
        case events.Failed(reason=reason, attempt=attempt, action=action):
            return FaultView(
                "A step failed, the robot was stopped",
                reason,
                f"The run does this now: {action.value} (attempt {attempt}).",
            )
        case events.Interrupted(reason=reason):
            return FaultView("The run ended early", reason, RESUMABLE)
        case HostFailed(problem=problem, action=action, exit_code=exit_code):
            title = "That was refused" if exit_code is None else "The run could not go on"
            return FaultView(title, problem, action)
