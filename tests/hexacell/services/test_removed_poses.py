"""What a person took out of the plan is never commanded: in the run, its resumption and its replay."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from hexacell.campaign.removed_poses import RemovedPose, RemovedPoses, removed_pose
from hexacell.errors import ExitCode, Interruption, UsageError
from hexacell.kinematics.pose import Pose
from hexacell.services.run.calibration_run import calibrate
from hexacell.services.run.replay_run import replay
from procedures.journal.journal import read_journal
from procedures.run import events
from procedures.run.commands import Abort, CommandQueue
from procedures.run.state import fold
from procedures.run.steps import Move, Phase, SixNumbers
from tests.hexacell.services.conftest import Approver, Finished, Site

THREE_POINTS = ((100.0, -100.0, 500.0), (0.0, 150.0, 520.0), (-100.0, 100.0, 500.0))
AMONG_THREE = {1: 1, 2: 3}
"""The points of the cell that was calibrated, and where they are among the three."""


def some_measured(finished: Finished) -> tuple[RemovedPose, ...]:
    """Some poses that the run of this cell went to, taken out."""
    samples = fold(finished.history).samples(Phase.IDENTIFY)
    references = [Pose(*one.pose) for one in samples if one.orientation == 1]
    poses = [one for one in samples if one.orientation in {3, 6}]
    placed = [(AMONG_THREE[one.at.point], Pose(*one.pose)) for one in poses]
    return tuple(removed_pose(point, pose, references, is_listed=False) for point, pose in placed)


def commanded(site: Site) -> list[SixNumbers]:
    begun = site.happened(events.StepBegun)
    return [event.step.pose for event in begun if isinstance(event.step, Move)]


async def test_others_are_measured_in_their_place_and_points_are_left(
    make_site: Callable[..., Site], finished: Finished, approver: Approver
) -> None:
    removed = RemovedPoses(points=(2,), poses=some_measured(finished))
    assert len(removed.poses) == 4
    site, queue = make_site(identification__points=THREE_POINTS), CommandQueue()

    def stop_early(event: events.Event, _: Any) -> None:
        if isinstance(event, events.SetClosed):
            queue.put(Abort())

    changes = {"operator": approver, "unattended": False, "removed": removed}
    with pytest.raises(Interruption):
        await calibrate(site.order(**changes), [stop_early], queue)
    changes["removed"] = RemovedPoses()  # a resumed run keeps its own
    ended = await site.calibrate(resume=True, **changes)
    assert ended.exit_code == ExitCode.DONE, ended.line
    assert commanded(site)
    assert all(removed.refused.allows(pose) for pose in commanded(site))
    records = fold(read_journal(site.folder.journal)).samples(Phase.IDENTIFY)
    assert len(records) == len(fold(finished.history).samples(Phase.IDENTIFY))
    assert {one.at.point for one in records} == {1, 3}
    report = await replay(site.folder.path)
    assert not report.differences, "a replay decides alike"


async def test_a_run_with_too_little_left_is_refused_before_anything_moves(
    make_site: Callable[..., Site],
) -> None:
    site = make_site()
    with pytest.raises(UsageError, match="1 of 2 points would be left"):
        await site.calibrate(removed=RemovedPoses(points=(1,)))
    assert not site.folder.path.exists()
