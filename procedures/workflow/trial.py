"""The steps that try the gauges, whenever they were placed or connected again.

From a recorded reference the ball is moved a millimetre along each axis of the base, and the gauges are
read. Back at the reference it is judged whether each of them follows the ball on its axis, with its sign
and scale (:mod:`hexacell.noise.gauge_trial`). Only then is anything else measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.errors import LimitError
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import ball_position
from procedures.run.keys import SetKey, ThreeNumbers
from procedures.run.state import RunState
from procedures.steps.move import Move
from procedures.steps.probe import Probe
from procedures.steps.registry import Step
from procedures.steps.try_gauges import Try
from procedures.workflow.sets import SetSteps, beside, reference_pose


@dataclass(frozen=True, eq=False)
class TrialSteps:
    """Decides on the steps of one robot's sets; ``distance_mm`` is the length of a move, 0 for no trial."""

    distance_mm: float
    sets: SetSteps

    def next_step(self, state: RunState, key: SetKey, ball: Array | None) -> Step | None:
        """The next step; None if no trial is due. Raises ``LimitError`` where no small move is possible.

        ``ball`` (3,), mm, is where the ball was when the gauges were zeroed, if that is known.
        """
        measured = state.set(key)
        if not self.distance_mm or measured.tried or not measured.samples:
            return None
        axis = len(measured.probes)
        if axis == 3:
            is_back = state.at_pose == (key, 1)
            return Try(at=key) if is_back else self.sets.to_reference(state, key, ball)
        moved = self._moved(state, key, axis)
        pose = beside(reference_pose(state, key), moved)
        if state.off_plan and state.target == pose:
            return Probe(at=key, moved_mm=moved)
        probed = [beside(reference_pose(state, key), probe.moved_mm) for probe in measured.probes[-1:]]
        is_beside = state.off_plan and not state.position_unknown and state.target in probed
        if state.at_pose != (key, 1) and not is_beside:
            return self.sets.to_reference(state, key, ball)
        return Move(at=key, orientation=0, pose=pose)

    def _moved(self, state: RunState, key: SetKey, axis: int) -> ThreeNumbers:
        """The move along an axis, to the side on which there is room."""
        belief = self.sets.robot.belief().zeroed_at(state.zero_shown(key))  # the robot as it was drawn
        reference = reference_pose(state, key)
        ball = ball_position(belief, self.sets.robot.from_commands([Pose(*reference)]))
        for side in (1.0, -1.0):
            x, y, z = (side * self.distance_mm * np.eye(3)[axis]).tolist()
            if self.sets.is_clear_both_ways(belief, reference, beside(reference, (x, y, z)), ball):
                return (x, y, z)
        raise LimitError(
            f"{key}: the gauges cannot be tried, because the robot cannot move by {self.distance_mm:g} mm "
            f"along {'xyz'[axis]} there within its limits",
            action="Choose another point, or a smaller trial_mm in [stations]",
        )
