"""Protects that a controller which takes corrections and does not obey them is told by its encoders."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.terms.corrected_joints import commanded_joints
from hexacell.kinematics.corrections import NO_CORRECTIONS, Corrections
from hexacell.kinematics.pose import PoseBatch
from hexacell.measurements.records import MeasurementSet, Record, joints_of
from hexacell.robot.model import Robot, robot_of
from hexacell.verdict.correction_evidence import correction_test
from tests.benchmarks.worlds.campaigns import setting

LAGGING = Corrections(backlash=(0.08,) * 6)
PLAYING = Corrections(play_mm=(0.2,) * 6, weight_n=100.0)
NOISE_MM = 0.01


@pytest.fixture(scope="module")
def robot(bundled_cell) -> Robot:
    return robot_of(bundled_cell)


def taken(robot: Robot, share: float, corrections: Corrections, known: bool = True) -> MeasurementSet:
    """Records of a controller that adds a share of what it corrects; its encoders err by a constant too."""
    commands = setting(0).commands.poses
    poses = [robot.to_command(commands.pose(row)) for row in range(len(commands))]
    random = np.random.default_rng(3)
    came = random.choice([-1, 1], (len(poses), 6))
    states, at = (robot.mechanism, robot.controller, robot.branch), PoseBatch.of(poses)
    bare, legs = (commanded_joints(*states, one, at)[0] for one in (NO_CORRECTIONS, corrections))
    added = legs - bare + 0.5 * np.array(corrections.backlash) * came
    joints = bare + share * added + 0.05 + NOISE_MM * random.standard_normal(bare.shape)
    rows = zip(poses, joints, came, strict=True)
    return MeasurementSet(
        tuple(
            Record(1, 1 + row, pose, joints_of(q), (0.0, 0.0, 0.0), tuple(d.tolist()) if known else ())
            for row, (pose, q, d) in enumerate(rows)
        )
    )


@pytest.mark.parametrize("corrections", [LAGGING, PLAYING], ids=["backlash", "play"])
@pytest.mark.parametrize(("share", "passes"), [(1.0, True), (0.8, True), (0.1, False), (0.0, False)])
def test_what_a_controller_adds_is_seen(robot: Robot, corrections, share: float, passes: bool) -> None:
    found = correction_test(replace(robot, corrections=corrections), taken(robot, share, corrections))
    assert found is not None
    assert found.passed is passes
    assert ("see that it reads them" in found.sentence) is not passes


def test_records_that_cannot_tell_are_no_evidence(robot: Robot) -> None:
    assert correction_test(robot, taken(robot, 0.0, LAGGING)) is None, "nothing is corrected"
    small = replace(LAGGING, backlash=(0.002,) * 6)
    assert correction_test(replace(robot, corrections=small), taken(robot, 0.0, small)) is None
    lagging = replace(robot, corrections=LAGGING)
    assert correction_test(lagging, taken(robot, 0.0, LAGGING, known=False)) is None
    assert correction_test(lagging, MeasurementSet(())) is None
