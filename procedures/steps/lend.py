"""Lend: the controller commands with a provisional geometry while the remaining points are measured."""

from dataclasses import replace
from typing import ClassVar, Literal

from hexacell.cell.fields import GeometryDocument
from hexacell.config.write_record import WriteKind
from procedures.resources.run_resources import RunResources
from procedures.run.cancellation import in_thread
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, StepWithoutMotion


class ProvisionalApplied(BaseEvent):
    """The controller commands with a provisional geometry while the points are measured.

    ``geometry`` is in the mechanism's frame convention. The earlier config is kept in ``folder``,
    a part of the run folder.
    """

    kind: Literal["lent"] = "lent"
    geometry: GeometryDocument
    folder: str

    def applied_to(self, state: RunState) -> RunState:
        """Equal joint variables are another pose now."""
        applied = replace(state, provisional=self, provisional_active=True, config_write_pending=False)
        return applied.without_position()

    def text(self, state: RunState) -> str:
        return "the controller uses a provisional geometry while the points are measured"


class Lend(StepWithoutMotion):
    """Give the controller the estimate of the geometry so far."""

    kind: Literal["lend"] = "lend"

    outcomes: ClassVar = (ProvisionalApplied,)
    doing: ClassVar[str] = "loading a provisional geometry"

    def begun_in(self, state: RunState) -> RunState:
        return replace(state, config_write_pending=True)

    async def perform(self, run: RunResources, state: RunState) -> ProvisionalApplied:
        """Write the config and have it read; raises ``WriteBackUndone`` if the controller does not."""
        geometry = await in_thread(run.calibration.known(state).provisional_geometry, state)
        config, written = run.config, run.calibration.robot.for_controller(geometry)
        await config.apply(
            await in_thread(config.change_to, written, state),
            config.provisional_backup,
            config.cause(WriteKind.PROVISIONAL, "to measure the remaining points with it"),
            action="Correct that, or run without `provisional`",
        )
        return ProvisionalApplied(geometry=geometry.document(), folder=config.provisional_backup.name)
