"""A controller with soft limits behind its real driver: the run keeps to them after a few refusals."""

from __future__ import annotations

import pytest

from hexacell.cell.simulation import SoftLimits
from hexacell.errors import ExitCode
from hexacell.services.run.replay_run import replay
from procedures.steps import events

LIMITS = SoftLimits(
    lowest=(-500.0, -500.0, 300.0, -10.0, -10.0, -12.0), highest=(500.0, 500.0, 700.0, 10.0, 10.0, 12.0)
)


@pytest.mark.slow
async def test_poses_that_the_controller_refuses_are_replaced_by_others(make_site, approver) -> None:
    site = make_site(simulation__soft_limits=LIMITS)
    ended = await site.calibrate(operator=approver, unattended=False)
    assert ended.exit_code == ExitCode.DONE, ended.line
    excluded = site.happened(events.PoseExcluded)
    assert excluded
    assert all("would exceed" in refusal.reason for refusal in excluded)
    arrived = {event.pose for event in site.happened(events.Arrived)}
    assert not arrived & {refusal.pose for refusal in excluded}
    assert len({refusal.pose for refusal in excluded}) == len(excluded), "none was sent twice"
    for pose in arrived:
        low = [value >= bound for value, bound in zip(pose, LIMITS.lowest, strict=True)]
        high = [value <= bound for value, bound in zip(pose, LIMITS.highest, strict=True)]
        assert all(low + high)
    report = await replay(site.folder.path)
    assert not report.differences, "a replay decides alike"
