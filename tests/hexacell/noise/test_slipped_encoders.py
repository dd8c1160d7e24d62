"""An encoder that slipped is told from a joint that stopped elsewhere, and from a gauge that slipped."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.identification.problem.random_walk import GaugeWalk
from hexacell.kinematics.pose import Pose
from hexacell.noise.allowances import Allowances
from hexacell.robot.model import robot_of

MEASURED = {"encoder": 0.0015, "gauge_mm": 0.0015}


@pytest.fixture(scope="module")
def change_of() -> Any:
    """The change at a reference by slips of encoders, motion of joints, and slips of gauges."""
    cell = load_cell(bundled_config("simulated-hexaglide"))
    reference = Pose(*cell.settings.identification.points[0])

    def change(*, slip: Any = 0.0, moved: Any = 0.0, gauge: Any = 0.0, **noise: Any) -> Any:
        stated = cell.settings.noise.model_copy(update={"revisits": noise.pop("revisits", 0)})
        robot = robot_of(cell)
        robot = replace(robot, noise=replace(robot.noise, **MEASURED | noise))
        settings = cell.settings.model_copy(update={"noise": stated})
        allowances = Allowances(settings, robot)
        by_joints = allowances.ball_at(reference).by_joints
        shift, ball = np.zeros(6) + moved, np.zeros(3) + gauge
        now = np.concatenate([by_joints @ shift + ball, shift + slip])
        return allowances.since(reference, np.zeros(9), now, readings=8)

    return change


def of_leg(leg: int, mm: float) -> Any:
    return mm * np.eye(6)[leg]


@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize("mm", [0.05, -0.05, 0.3])
def test_a_slip_of_any_encoder_is_found(change_of, leg: int, mm: float) -> None:
    assert change_of(slip=of_leg(leg, mm)).slipped_encoder() == leg
    scatter = 0.001 * np.random.default_rng(leg).standard_normal(6)
    assert change_of(slip=of_leg(leg, mm), moved=scatter, stops=0.001).slipped_encoder() == leg


@pytest.mark.parametrize(
    "changed",
    [
        {"moved": of_leg(2, 0.05)},
        {"moved": np.full(6, 0.2)},
        {"gauge": 0.2 * np.eye(3)[1]},
        {"slip": of_leg(2, 0.008)},
        {"slip": of_leg(2, 0.05), "stops": 0.02},
        {"slip": of_leg(2, 0.05), "walk": GaugeWalk(0.1)},
        {"slip": of_leg(2, 0.05), "revisits": 4},
    ],
    ids=[
        "a joint",
        "all joints",
        "a gauge",
        "noise",
        "a machine that scatters",
        "drift",
        "not yet measured",
    ],
)
def test_nothing_else_is_taken_for_a_slip(change_of, changed: Any) -> None:
    """The limit is what this machine was measured to repeat by, not a number."""
    assert change_of(**changed).slipped_encoder() is None


STATED = {"encoder": 0.01, "gauge_mm": 0.01}
AGREEMENT_MM = 0.05


def test_gauges_that_were_moved_are_seen_where_no_axis_shows_more_than_chance(change_of) -> None:
    """What joints do along x and z they do along y as well: chance does not do it along these alone."""
    moved = change_of(gauge=[0.07, -0.03, -0.08], **STATED)
    assert not moved.exceeds(AGREEMENT_MM)
    assert moved.is_unlikely(AGREEMENT_MM)
    agreeing = change_of(gauge=[0.04, -0.03, -0.04], **STATED)
    assert [agreeing.is_unlikely(limit_mm) for limit_mm in (AGREEMENT_MM, 0.0)] == [False, True]


def test_noise_does_not_move_gauges(change_of) -> None:
    random = np.random.default_rng(3)

    def drawn() -> Any:
        read = {
            name: np.sqrt(2.0) * 0.01 * random.standard_normal(n) for name, n in (("slip", 6), ("gauge", 3))
        }
        return change_of(**read, **STATED)

    changes = [drawn() for _ in range(60)]
    assert np.mean([np.abs(one.unexplained_mm).max() > AGREEMENT_MM for one in changes]) > 0.3
    assert np.mean([one.is_unlikely(0.0) for one in changes]) <= 0.05
