"""Take back: the controller gets its own geometry again after the provisional one."""

from dataclasses import replace
from typing import ClassVar, Literal

from hexacell.config.write_record import WriteKind
from hexacell.errors import HexacellError
from procedures.resources.controller_config import holds_provisional
from procedures.resources.run_resources import RunResources
from procedures.run.cancellation import in_thread
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, StepWithoutMotion


class ProvisionalReverted(BaseEvent):
    """The controller has read the config that it had before the provisional geometry."""

    kind: Literal["taken back"] = "taken back"

    def applied_to(self, state: RunState) -> RunState:
        """Equal joint variables are another pose now."""
        return replace(state, provisional_active=False, config_write_pending=False).without_position()

    def text(self, state: RunState) -> str:
        return "the controller uses its own geometry again"


class TakeBack(StepWithoutMotion):
    """Give the controller the geometry that it had before the provisional one."""

    kind: Literal["take back"] = "take back"

    outcomes: ClassVar = (ProvisionalReverted,)
    doing: ClassVar[str] = "restoring the controller's geometry"

    def begun_in(self, state: RunState) -> RunState:
        return replace(state, config_write_pending=True)

    async def perform(self, run: RunResources, state: RunState) -> ProvisionalReverted:
        config = run.config
        is_written = holds_provisional(run.folder, run.cell.config_paths)
        if is_written:
            cause = config.cause(WriteKind.PROVISIONAL_TAKEN_BACK, "it was to be used in the run alone")
            await config.restore(config.provisional_backup, cause)
        else:
            config.require_begun_with(state)
        try:
            await run.startup.reload()
        except HexacellError:
            # Far from level, the slider positions may belong to no pose of the old geometry. The file
            # must not differ from what the controller has until it can be reloaded.
            provisional = run.calibration.provisional_of(state)
            if is_written and provisional is not None:
                geometry = run.calibration.robot.for_controller(provisional)
                change = await in_thread(config.change_to, geometry, state)
                cause = config.cause(WriteKind.PROVISIONAL, "the controller does not take the old one here")
                await config.write(change, config.provisional_backup, cause)
            raise
        return ProvisionalReverted()
