"""Every stop reached from the same side, where the cell file wants that: moves get a waypoint before it.

It is checked as the move itself is. Where no waypoint is possible the robot goes straight, which the run
says; from which side the joints then arrived is known from the path.
"""

from dataclasses import dataclass
from typing import Self

from hexacell.cell.model import CellSettings
from hexacell.motion.arrival import least_way
from hexacell.motion.overshoot import clear_waypoint_before, overshoot
from procedures.run.state import RunState
from procedures.steps.move import Move
from procedures.workflow.sets import SetSteps


@dataclass(frozen=True, eq=False)
class Approach:
    """How the stops of one robot are reached.

    Attributes:
        sets: the moves of the robot.
        back: by how much joints go up from the waypoint to the stop, in their unit; below 0 if they go
            down, 0 for moves as they are.
    """

    sets: SetSteps
    back: float

    @classmethod
    def of(cls, settings: CellSettings, sets: SetSteps, stops: float) -> Self:
        """As a cell file wants it, of joints with ``stops``, one sigma, beside their commands."""
        least = least_way(settings.mechanism.words.joint_unit, stops)
        return cls(sets, settings.motion.sign * overshoot(least, settings.model.backlash))

    def of_move(self, move: Move, state: RunState) -> Move:
        """The move over its waypoint, or straight where there is none."""
        if not self.back:
            return move
        belief, reference = self.sets.known(state, move.at)
        start = None if state.target is None else self.sets.command(state.target)
        stop = self.sets.command(move.pose)
        waypoint = clear_waypoint_before(belief, start, stop, self.back, reference)
        if waypoint is None:
            return move.model_copy(update={"straight": True})
        pose = self.sets.robot.to_command(waypoint.pose(0)).as_tuple()
        return move.model_copy(update={"waypoint": pose})
