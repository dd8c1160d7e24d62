"""All poses that a point's records could be of: within the robot's limits, the ball at the gauges' zero.

Those that the program would choose among if it knew the robot beforehand. The gauges' travel is for what is
not known of the robot, so that none of it is spent on going elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexacell.design.candidates import ReachableTargets, reachable_targets
from hexacell.design.continuous_design.measure import PossibleRecords
from hexacell.design.predicted_records import GaugeZero, position_derivatives
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.measurement_model import record_weights
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, eq=False)
class PoseDomain:
    """The poses at a point of the robot as it is estimated, whose gauges were zeroed at ``zero``."""

    belief: RobotBelief
    zero: GaugeZero

    def spread(self, count: int, seed: int) -> ReachableTargets:
        """Those of ``count`` poses (a power of two) all over tilt and turn that are possible."""
        from scipy.stats import qmc  # noqa: PLC0415 - half a second that only this function needs

        heading, tilted, turned = qmc.Sobol(3, seed=seed).random(count).T
        limits, zeros = self.belief.limits, np.zeros(count)
        angle, heading = limits.tilt * np.sqrt(tilted), 2.0 * np.pi * heading
        directions = np.stack([np.cos(heading), np.sin(heading), zeros], axis=-1)
        turn = limits.turn * (2.0 * turned - 1.0)
        tilts = rotations.from_vector(angle[:, None] * directions)
        turns = rotations.from_vector(np.stack([zeros, zeros, turn], axis=-1))
        return self._possible(limits.orientations(tilts @ turns))

    def around(self, targets: ReachableTargets, angle: float, random: np.random.Generator) -> Array:
        """An orientation (n, 3, 3) near each of n targets.

        It is turned from that by at most ``angle``, rad, about each axis.
        """
        turns = rotations.from_vector(random.uniform(-angle, angle, (len(targets), 3)))
        around: Array = turns @ targets.poses.rotations
        return around

    def possible_rows(self, orientations: Array) -> tuple[ReachableTargets, NDArray[np.intp]]:
        """The possible ones of some orientations (n, 3, 3), and their rows."""
        found = self._possible(orientations)
        matches = (orientations[:, None] == found.poses.rotations[None]).all(axis=(-2, -1))
        return found, np.argmax(matches, axis=0)

    def records(self, targets: ReachableTargets) -> PossibleRecords:
        """The records of some targets."""
        jacobian, by_joints = position_derivatives(self.belief, targets)
        return PossibleRecords.of(jacobian, record_weights(by_joints, self.belief.noise))

    def _possible(self, orientations: Array) -> ReachableTargets:
        poses = PoseBatch.at(self.zero.reference, orientations)
        return reachable_targets(self.belief, poses, self._mode)

    @cached_property
    def _mode(self) -> Array:
        return self.zero.mode(self.belief)
