"""Place: the gauges are put around the ball, by a person unless they are fixed."""

from typing import ClassVar, Literal

from hexacell.campaign.time_model import TimeKind
from hexacell.cell.model import CellSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from procedures.resources.run_resources import RunResources
from procedures.run.keys import Phase, SetKey, SixNumbers
from procedures.run.questions import ask_placement
from procedures.run.state import RunState
from procedures.steps.base import EventOfSet, StepOfSet


class MountingError(DeviceError):
    """Gauges are not mounted as a set needs them; nothing can be measured with them before they are."""


class GaugesPlaced(EventOfSet):
    """The gauges are placed around the ball."""

    kind: Literal["placed"] = "placed"

    def applied_to(self, state: RunState) -> RunState:
        return state.with_changed_set(self.at, placed=True)


class Place(StepOfSet):
    """Have the gauges put around the ball, plungers in the middle of their travel."""

    kind: Literal["place"] = "place"
    pose: SixNumbers

    outcomes: ClassVar = (GaugesPlaced,)
    takes: ClassVar[TimeKind] = TimeKind.PLACING
    doing: ClassVar[str] = "the gauges are to be placed"

    async def perform(self, run: RunResources, state: RunState) -> GaugesPlaced:
        """Ask a person where one is needed; the robot stands still meanwhile."""
        if not are_fixed(run.settings, self.at):
            question = ask_placement(self.at, Pose(*self.pose))
            await run.guards.at_standstill(lambda: run.operator.ask(question))
        return GaugesPlaced(at=self.at)


def are_fixed(settings: CellSettings, at: SetKey) -> bool:
    """Whether nobody has to bring the gauges of a set to the ball."""
    if at.phase is Phase.LENGTH and settings.length_check is not None:
        return settings.length_check.mounting == "fixed"
    return settings.stations.placement == "fixed"
