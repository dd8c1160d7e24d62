"""What a person takes out of a plan: what is kept out with a pose, and what must be left."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hexacell.campaign.pose_list import PoseList
from hexacell.campaign.removed_poses import RemovedPose, RemovedPoses, removed_pose, require_enough
from hexacell.errors import UsageError
from hexacell.kinematics.pose import Pose, PoseBatch

REFERENCE = Pose(0.0, 0.0, 550.0)
ELSEWHERE = Pose(0.0, -200.0, 550.0, 3.0, 0.0, 0.0)


@pytest.mark.parametrize(("tilt", "within"), [(40.0, 5.0), (10.0, 5.0), (4.0, 2.0), (0.6, 0.3)])
def test_nothing_near_a_reference_is_kept_out(tilt: float, within: float) -> None:
    removed = removed_pose(1, Pose(0.0, 0.0, 550.0, tilt), [REFERENCE, ELSEWHERE], is_listed=False)
    assert removed.within_deg == pytest.approx(within, abs=1e-3)
    refused = RemovedPoses(poses=(removed,)).refused
    assert refused.allows(REFERENCE.as_tuple())
    assert not refused.allows((5.0, 0.0, 550.0, tilt + 0.9 * within, 0.0, 0.0))
    assert refused.allows((5.0, 0.0, 550.0, tilt + 1.1 * within, 0.0, 0.0))


def test_a_reference_is_not_taken_out_alone() -> None:
    with pytest.raises(UsageError, match="reference of a point"):
        removed_pose(1, REFERENCE, [REFERENCE], is_listed=False)


def test_of_a_list_the_pose_itself_is_left_out_and_no_other() -> None:
    poses = tuple(Pose(0.0, 0.0, 550.0, tilt) for tilt in (0.0, 10.0, 11.0))
    listed = PoseList(Path("list.csv"), (poses, poses))
    removed = RemovedPoses(poses=(removed_pose(1, poses[1], [poses[0]], is_listed=True),))
    left = removed.left_of(listed)
    assert left is not None
    assert left.poses == ((poses[0], poses[2]),) * 2
    assert RemovedPoses().left_of(None) is None


@pytest.mark.parametrize(
    ("points", "said"), [((1, 2, 3, 4), "1 of 5 points would be left"), ((6,), "no point 6")]
)
def test_what_leaves_too_little_is_refused(points: tuple[int, ...], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        require_enough(RemovedPoses(points=points), 5)
    require_enough(RemovedPoses(points=(1, 2, 3)), 5)


def test_angles_between_orientations() -> None:
    some = PoseBatch.of([Pose(0, 0, 0, 30.0), Pose(0, 0, 0, 0.0, 0.0, -90.0), Pose(0, 0, 0)])
    angles = np.degrees(some.angles_to(PoseBatch.of([Pose(0, 0, 0)])))
    assert angles == pytest.approx([30.0, 90.0, 0.0], abs=1e-6)


def test_what_is_kept_is_read_again() -> None:
    removed = RemovedPoses(
        points=(3,), poses=(RemovedPose(point=1, pose=ELSEWHERE.as_tuple(), within_mm=30, within_deg=5),)
    )
    assert RemovedPoses.model_validate_json(removed.model_dump_json()) == removed
