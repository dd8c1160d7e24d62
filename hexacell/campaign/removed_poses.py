"""What a person takes out of the plan before a run begins: points, and poses with what is near them.

A pose of a list is taken out alone. Selected poses are decided on as a run goes, so a run never commands
exactly what a preview has shown: with such a pose, all commands near it are kept out, at its end as on the
way. What is kept out never contains the reference of a point that is measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from hexacell.campaign.pose_list import PoseList
from hexacell.cell.fields import Frozen, NotNegative, SixNumbers
from hexacell.errors import UsageError
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.refused_commands import RefusedCommand, RefusedCommands

NEAR_MM = 30.0
"""A command is as far from its point as the errors of the geometry make it, some 10 mm at most."""

NEAR_DEG = 5.0

FEWEST_POINTS = 2
"""From one alone the geometry cannot be identified."""


class RemovedPose(Frozen):
    """A pose at a point that is not commanded, in the controller's frames, and how near to it none is."""

    point: Annotated[int, Field(ge=1)]
    pose: SixNumbers
    within_mm: NotNegative = 0.0
    within_deg: NotNegative = 0.0


class RemovedPoses(Frozen):
    """Everything that is taken out; nothing at first. Points are counted from 1."""

    points: tuple[Annotated[int, Field(ge=1)], ...] = ()
    poses: tuple[RemovedPose, ...] = ()

    @property
    def refused(self) -> RefusedCommands:
        """The same as what the limits of motion know of it."""
        return RefusedCommands(
            tuple(
                RefusedCommand(one.pose, within_mm=one.within_mm, within_deg=one.within_deg)
                for one in self.poses
            )
        )

    def left_of(self, listed: PoseList | None) -> PoseList | None:
        """A list of poses without those that are taken out; none of none."""
        if listed is None:
            return None
        kept = (tuple(pose for pose in at if self.refused.allows(pose.as_tuple())) for at in listed.poses)
        return PoseList(listed.path, tuple(kept))


NOTHING_REMOVED = RemovedPoses()


def removed_pose(point: int, pose: Pose, references: Sequence[Pose], *, is_listed: bool) -> RemovedPose:
    """What is kept out with a pose at a point; ``references`` are of all points.

    Raises:
        UsageError: the pose is one of them.
    """
    if is_listed:
        return RemovedPose(point=point, pose=pose.as_tuple())
    angles = [_angle_deg(pose, reference) for reference in _near(pose, references)]
    nearest = min(angles, default=2.0 * NEAR_DEG)
    if nearest == 0.0:
        raise UsageError(
            "the reference of a point cannot be taken out alone", action="Take out the whole point"
        )
    return RemovedPose(
        point=point,
        pose=pose.as_tuple(),
        within_mm=NEAR_MM,
        within_deg=min(NEAR_DEG, round(0.5 * nearest, 3)),
    )


def require_enough(removed: RemovedPoses, points: int) -> None:
    """Refuse what leaves too little of a plan of so many points.

    Raises:
        UsageError: a point does not exist, or too few are left.
    """
    if unknown := [point for point in removed.points if point > points]:
        raise UsageError(
            f"there is no point {unknown[0]}, the plan has {points}", action="Choose one of its points"
        )
    left = points - len(set(removed.points))
    if left < FEWEST_POINTS:
        raise UsageError(
            f"{left} of {points} points would be left, and the geometry needs {FEWEST_POINTS}",
            action="Put a point back",
        )


def _near(pose: Pose, references: Iterable[Pose]) -> list[Pose]:
    """Those of some poses that are at the same place."""
    return [one for one in references if np.linalg.norm(one.position - pose.position) <= NEAR_MM]


def _angle_deg(pose: Pose, other: Pose) -> float:
    """The angle between two orientations."""
    return float(np.degrees(PoseBatch.of([pose]).angles_to(PoseBatch.of([other]))[0]))
