"""Commands that a controller refused or the cell file excludes, and what that says about others.

A command beyond the limit of an axis says that every command at least as far out along it is refused as
well. One that the cell file excludes may concern all that are near it. Any other refusal concerns that
command alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.mechanism import FrameTransform
from hexacell.kinematics.pose import AXES, Pose, PoseBatch
from hexacell.kinematics.rotations import Mask


@dataclass(frozen=True, slots=True)
class RefusedCommand:
    """One command, in the controller's frames.

    Attributes:
        pose: x, y, z, a, b, c, mm and deg.
        axis: the axis beyond whose limit it is, one of ``xyzabc``; none if another reason was given.
        is_highest: whether that is the axis' highest value, not its lowest.
        within_mm: commands that are as near as this and as ``within_deg`` are concerned as well, unless
            that is zero.
    """

    pose: tuple[float, float, float, float, float, float]
    axis: str | None = None
    is_highest: bool = True
    within_mm: float = 0.0
    within_deg: float = 0.0

    def concerns(self, poses: PoseBatch) -> Mask:
        """Which of n commands, in the controller's frames, are this one, near it, or as far out."""
        this = PoseBatch.of([Pose(*self.pose)])
        concerned = np.asarray(poses.is_same(this))
        if self.within_deg > 0.0:
            apart = np.linalg.norm(poses.positions - this.positions, axis=-1)
            concerned |= (apart <= self.within_mm) & (poses.angles_to(this) <= np.radians(self.within_deg))
        if self.axis is None:
            return concerned
        column, sign = AXES.index(self.axis), 1.0 if self.is_highest else -1.0
        beyond = sign * (poses.numbers()[:, column] - self.pose[column]) >= 0.0
        return np.asarray(concerned | beyond)


@dataclass(frozen=True, slots=True)
class RefusedCommands:
    """All of them; none at first."""

    commands: tuple[RefusedCommand, ...] = ()

    def __or__(self, others: RefusedCommands) -> RefusedCommands:
        """These commands and others, each once."""
        return RefusedCommands(tuple(dict.fromkeys((*self.commands, *others.commands))))

    def allow(self, poses: PoseBatch, frames: FrameTransform | None = None) -> Mask:
        """Which of n commands no refusal concerns.

        They are in the controller's frames, or in those that ``frames`` leads to from there.
        """
        allowed = np.ones(len(poses), dtype=bool)
        if not self.commands:
            return allowed
        commands = poses if frames is None else frames.inverse().poses(poses)
        for refused in self.commands:
            allowed &= ~refused.concerns(commands)
        return allowed

    def allows(self, pose: tuple[float, float, float, float, float, float]) -> bool:
        """The same of a single command, in the controller's frames."""
        return bool(self.allow(PoseBatch.of([Pose(*pose)]))[0])
