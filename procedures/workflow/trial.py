"""The steps that try the gauges, whenever they were placed or connected again.

From a recorded reference the ball is moved a millimetre along each axis of the base, and the gauges are
read. Back at the reference it is judged whether each of them follows the ball on its axis, with its sign
and scale (:mod:`hexacell.noise.gauge_trial`). Where they seem not to, the moves are repeated, twice as far
each time as long as the gauges' travel allows. Only then is anything else measured.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from hexacell.errors import LimitError
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import ball_position
from hexacell.noise.allowances import Allowances
from hexacell.noise.gauge_trial import AXES
from procedures.run.keys import SetKey, ThreeNumbers
from procedures.run.state import RunState, SetState
from procedures.steps.move import Move
from procedures.steps.probe import Probe
from procedures.steps.registry import Step
from procedures.steps.try_gauges import Try, trial_of
from procedures.workflow.sets import SetSteps, beside, reference_pose

FARTHEST_SHARE = 0.3
"""Length of the largest moves, as a share of the gauges' travel."""


@dataclass(frozen=True, eq=False)
class TrialSteps:
    """Decides on the steps of one robot's sets; ``distance_mm`` is the length of a move, 0 for no trial."""

    distance_mm: float
    sets: SetSteps
    allowances: Allowances

    def next_step(self, state: RunState, key: SetKey, ball: Array | None) -> Step | None:
        """The next step; None if no trial is due. Raises ``LimitError`` where no small move is possible.

        ``ball`` (3,), mm, is where the ball was when the gauges were zeroed, if that is known.
        """
        measured = state.set(key)
        if not self.distance_mm or measured.tried or not measured.samples:
            return None
        rounds, axis = divmod(len(measured.probes), AXES)
        if rounds and axis == 0 and self._decides(measured, rounds):
            is_back = state.at_pose == (key, 1)
            return Try(at=key) if is_back else self.sets.to_reference(state, key, ball)
        moved = self._moved(state, key, axis, self._distances[rounds])
        pose = beside(reference_pose(state, key), moved)
        if state.off_plan and state.target == pose:
            return Probe(at=key, moved_mm=moved)
        probed = [beside(reference_pose(state, key), probe.moved_mm) for probe in measured.probes[-1:]]
        is_beside = state.off_plan and not state.position_unknown and state.target in probed
        if state.at_pose != (key, 1) and not is_beside:
            return self.sets.to_reference(state, key, ball)
        return Move(at=key, orientation=0, pose=pose)

    @cached_property
    def _distances(self) -> tuple[float, ...]:
        """Lengths of the moves of each round; at the largest there are two."""
        farthest = max(self.distance_mm, FARTHEST_SHARE * self.sets.robot.limits.room.smallest_mm)
        doublings = int(np.log2(farthest / self.distance_mm))
        smaller = [self.distance_mm * 2.0**doubling for doubling in range(doublings + 1)]
        return (*smaller, farthest, farthest)

    def _decides(self, measured: SetState, rounds: int) -> bool:
        """Whether so many rounds decide: the gauges are as they should be, or there is no larger move."""
        return rounds >= len(self._distances) or not trial_of(self.allowances, measured).findings

    def _moved(self, state: RunState, key: SetKey, axis: int, farthest_mm: float) -> ThreeNumbers:
        """The move along an axis, to the side on which there is room, as far as there is."""
        belief = self.sets.robot.belief().zeroed_at(state.zero_shown(key))  # the robot as it was drawn
        reference = reference_pose(state, key)
        ball = ball_position(belief, self.sets.robot.from_commands([Pose(*reference)]))
        for distance, side in product(dict.fromkeys((farthest_mm, self.distance_mm)), (1.0, -1.0)):
            x, y, z = (side * distance * np.eye(AXES)[axis]).tolist()
            if self.sets.is_clear_both_ways(belief, reference, beside(reference, (x, y, z)), ball):
                return (x, y, z)
        raise LimitError(
            f"{key}: the gauges cannot be tried, because the robot cannot move by {self.distance_mm:g} mm "
            f"along {'xyz'[axis]} there within its limits",
            action="Choose another point, or a smaller trial_mm in [stations]",
        )
