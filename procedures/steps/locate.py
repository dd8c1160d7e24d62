"""Locate: where the robot is, after that had been unknown."""

from dataclasses import replace
from typing import ClassVar, Literal

from hexacell.cell.fields import JointNumbers
from hexacell.measurements.records import joints_of
from procedures.resources.run_resources import RunResources
from procedures.run.keys import SixNumbers
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, BaseStep


class Located(BaseEvent):
    """Controller and encoders agree on where the robot is.

    ``joints`` are the controller's joint variables, None where it reports none; mm or deg.
    """

    kind: Literal["located"] = "located"
    pose: SixNumbers
    joints: JointNumbers | None
    encoders: JointNumbers

    def applied_to(self, state: RunState) -> RunState:
        """The robot is at a pose of no set, and from which side its joints arrived is not known."""
        located = replace(state.without_position(), off_plan=True, target=self.pose)
        return replace(located, position_unknown=False)


class Locate(BaseStep):
    """Ask the controller for its pose: no path can be checked from an unknown one."""

    kind: Literal["locate"] = "locate"

    outcomes: ClassVar = (Located,)
    doing: ClassVar[str] = "asking the controller where the robot is"

    async def perform(self, run: RunResources, state: RunState) -> Located:
        """Compare what controller and encoders report; raises ``GuardTripped`` if they do not agree."""
        found = await run.locate()
        return Located(
            pose=found.pose.as_tuple(),
            joints=None if found.joints is None else joints_of(found.joints),
            encoders=joints_of(found.encoders),
        )
