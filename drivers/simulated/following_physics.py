"""The true state of a robot whose joints a real controller moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.simulated.joint_source import JointSource
from drivers.simulated.kept_gauges import KeptGauges
from drivers.simulated.physics import Motion, RobotPhysics
from hexacell.kinematics.rotations import Array

LONGEST_STEP_MM = 5.0
"""Of a joint variable between two solutions of the pose, so that the assembly mode is kept."""

MOVED_MM = 1e-4


class FollowingPhysics(RobotPhysics):
    """Where the joints are is what ``source`` says; before it says anything, at the first point."""

    def __init__(self, source: JointSource, kept: KeptGauges, *arguments: Any) -> None:  # noqa: ANN401 - those of its base
        super().__init__(*arguments)
        self._source = source
        self._kept: KeptGauges | None = kept
        self._draw_noise()

    def _update(self) -> float:
        now = self._clock.now()
        for shown in self._source.passed():
            self._follow(shown / self._shown_per_mm, now)
            if (
                self._kept is not None
            ):  # before, the ball was at the first point for want of anything better
                self._kept.restore(self.gauges)
                self._kept = None
        return now

    def encoder_positions(self) -> Array:
        """The joint variables measured by the encoders (6,)."""
        with self._lock:
            self._update()
            return super().encoder_positions()

    def _follow(self, joints: Array, now: float) -> None:
        step = joints - self._joints
        largest = float(np.abs(step).max())
        if largest < MOVED_MM:
            return
        if self._motion.end_s < now - RESTING_S:  # it stood, and another move begins
            self._draw_noise()
            self.on_motion_start()
        for share in np.linspace(0.0, 1.0, int(np.ceil(largest / LONGEST_STEP_MM)) + 1)[1:]:
            self._move_platform(joints - (1.0 - share) * step)
        self._motion = Motion(np.stack([joints, joints]), now, 0.0)


RESTING_S = 0.2
"""Without a change of the joints for longer, the robot stands."""
