"""Which of the robots within the tolerances can stand at a point, before they are calibrated."""

import numpy as np
import pytest

from hexacell.campaign.feasibility import unreachable_share
from hexacell.robot.virtual_robot import VirtualRobot, robots_within_tolerances
from tests.hexacell.campaign.conftest import make


def with_cones(degrees: float):
    plan = make()
    joints = plan.settings.limits.passive_joints.model_copy(
        update={"base_cone_deg": degrees, "platform_cone_deg": degrees}
    )
    return make(limits__passive_joints=joints, limits__leg_distance_mm=0.0)


@pytest.fixture(scope="module")
def shares():
    return {degrees: unreachable_share(with_cones(degrees)) for degrees in (180.0, 45.0, 30.0)}


def test_without_cones_only_singularities_count(shares) -> None:
    plan = with_cones(180.0)
    references = plan.robot.from_commands([plan.reference_pose(point) for point in plan.points])
    robots = robots_within_tolerances(
        plan.robot, plan.effort.checked_robots, plan.settings.identification.seed
    )
    taken = np.mean([VirtualRobot(plan.robot, truth).can_take(references) for truth in robots], axis=0)
    assert list(shares[180.0].values()) == pytest.approx((1.0 - taken).tolist())


def test_a_joint_beyond_its_cone_makes_a_point_one_that_cannot_be_reached(shares) -> None:
    for point, share in shares[45.0].items():
        assert shares[180.0][point] <= share <= shares[30.0][point]
    assert sum(shares[45.0].values()) > sum(shares[180.0].values())
    assert min(shares[30.0].values()) > 0.0
