"""Roll back: the controller gets the config that it had before the run, bit for bit."""

from dataclasses import replace
from typing import ClassVar, Literal

from hexacell.config.write_record import WriteKind
from procedures.resources.run_resources import RunResources
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, StepWithoutMotion


class RolledBack(BaseEvent):
    """The controller has read the config that it had before the run, bit for bit."""

    kind: Literal["rolled back"] = "rolled back"

    def applied_to(self, state: RunState) -> RunState:
        """Without a verdict the proposal is open again, and the sets measured after it do not count."""
        state = replace(state, rolling_back=False).without_position()
        if state.judged is not None:
            return replace(state, rolled_back=True)
        kept = {key: value for key, value in state.sets.items() if not key.phase.has_new_geometry}
        return replace(state, committed=None, confirmation=None, sets=kept)

    def text(self, state: RunState) -> str:
        return "the old geometry is back in the controller"


class RollBack(StepWithoutMotion):
    """Give the controller the geometry that it had before the run."""

    kind: Literal["roll back"] = "roll back"

    outcomes: ClassVar = (RolledBack,)
    doing: ClassVar[str] = "restoring the old config"
    is_reproducible: ClassVar[bool] = False

    def begun_in(self, state: RunState) -> RunState:
        return replace(state, rolling_back=True)

    async def perform(self, run: RunResources, state: RunState) -> RolledBack:
        cause = run.config.cause(WriteKind.TAKEN_BACK, reason_to_take_back(state))
        await run.config.restore(run.folder.path, cause)
        await run.startup.reload()
        return RolledBack()


def reason_to_take_back(state: RunState) -> str:
    """Why a written result does not stay."""
    if state.judged is None:
        return "it could not be verified"
    nobody = state.accepted is not None and state.accepted.by is None
    return f"nobody kept it: {state.judged.line}" if nobody else state.judged.line
