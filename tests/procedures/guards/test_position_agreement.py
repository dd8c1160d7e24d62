"""What a controller reports beside its encoders: which one is odd, and whether it still works."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.config.interface import ControllerGeometry
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import robot_of
from procedures.guards.position_check import (
    PositionMismatch,
    PositionReports,
    PositionSource,
    position_mismatch,
)
from procedures.run.keys import Phase, SetKey
from procedures.run.trips import Guard, GuardTripped
from procedures.steps.move import Move

ROBOT = robot_of(load_cell(bundled_config("simulated-hexaglide")))
TOLERANCES = {"position_mm": 0.01, "following": 1.0}
HOME = Pose(0.0, 0.0, 550.0)
THERE = Pose(60.0, -80.0, 520.0, 20.0, -15.0, 30.0)


def joints_at(pose: Pose, geometry: Geometry | None = None) -> Array:
    poses = PoseBatch.of([pose])
    joints: Array = inverse_kinematics(Hexaglide(), geometry or ROBOT.controller, ROBOT.branch, poses)[0]
    return joints


def rounded(pose: Pose) -> Pose:
    return Pose(*(round(number, 6) for number in pose.as_tuple()))


def mismatch(reports: PositionReports, geometry: Geometry | None = None) -> PositionMismatch | None:
    return position_mismatch(
        Hexaglide(), ControllerGeometry(geometry or ROBOT.controller, ROBOT.branch), reports, **TOLERANCES
    )


def reports(**changes: Any) -> PositionReports:
    """What an honest controller reports with six decimals, and encoders that are off by 0.9 mm."""
    joints = joints_at(THERE)
    off = 0.9 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    return replace(PositionReports(rounded(THERE), np.round(joints, 6), joints + off), **changes)


@pytest.mark.parametrize("pose", [HOME, THERE, Pose(0.0, 0.0, 550.0, -30.0, 5.0, -50.0)])
def test_reports_of_one_place_agree_up_to_rounding_and_the_encoders_zeros(pose: Pose) -> None:
    joints = joints_at(pose)
    assert mismatch(PositionReports(rounded(pose), np.round(joints, 6), joints + 0.99)) is None
    assert mismatch(PositionReports(rounded(pose), None, joints - 0.99)) is None


OUT_OF_REACH = Pose(0.0, 0.0, 2000.0)


@pytest.mark.parametrize(
    ("changes", "odd"),
    [
        ({"pose": HOME}, PositionSource.POSE),
        ({"pose": OUT_OF_REACH}, PositionSource.POSE),
        ({"joints": joints_at(HOME)}, PositionSource.JOINTS),
        ({"pose": HOME, "joints": joints_at(THERE) + 30.0}, None),
        ({"pose": HOME, "joints": None}, None),
    ],
)
def test_the_report_that_the_two_others_contradict_is_odd(changes, odd):
    shown = reports(**changes)
    found = mismatch(shown)
    assert found is not None
    assert found.odd is odd
    assert found.is_pose_near is ("pose" not in changes)
    leg, is_near = found.leg - 1, shown.pose is not OUT_OF_REACH
    assert found.by_pose == (pytest.approx(joints_at(shown.pose)[leg], abs=1e-4) if is_near else None)
    assert found.joint == (None if shown.joints is None else shown.joints[leg])


@pytest.mark.parametrize("name", ["S1x", "B4y", "l6"])
def test_a_geometry_that_differs_by_a_twentieth_is_odd_although_the_encoders_agree(name: str) -> None:
    vector = ROBOT.controller.vector.copy()
    vector[ROBOT.controller.parameters.rows((name,))] += 0.05
    found = mismatch(reports(), Geometry(ROBOT.controller.parameters, vector))
    assert found is not None
    assert found.odd is PositionSource.POSE
    assert found.is_pose_near
    assert found.leg == int(name[1])


def test_another_branch_is_another_geometry() -> None:
    branch: Any = tuple(-side for side in ROBOT.branch)
    found = position_mismatch(
        Hexaglide(), ControllerGeometry(ROBOT.controller, branch), reports(), **TOLERANCES
    )
    assert found is not None
    assert found.odd is PositionSource.POSE


@pytest.mark.parametrize("leg", range(1, 7))
def test_an_encoder_that_contradicts_pose_and_joints_is_named(leg: int) -> None:
    encoders = joints_at(THERE)
    encoders[leg - 1] += 1.5
    found = mismatch(reports(encoders=encoders))
    assert found is not None
    assert found.odd is PositionSource.ENCODERS
    assert found.leg == leg
    assert found.encoder == encoders[leg - 1]


def test_a_servo_that_trembles_by_its_tolerance_is_no_mismatch() -> None:
    assert mismatch(reports(joints=joints_at(THERE) + 0.009)) is None


P1, V1 = SetKey(phase=Phase.IDENTIFY, point=1), SetKey(phase=Phase.BEFORE, point=1)
STALE_S = 0.12


def move(at: SetKey) -> Move:
    x, y, z = (100.0, -100.0, 500.0) if at is P1 else (-100.0, -50.0, 450.0)
    return Move(at=at, orientation=1, pose=(x, y, z, 0.0, 0.0, 0.0))


@pytest.fixture
def stage(scene: Any) -> Any:
    """A scene whose controller reports where its joints are, until ``frozen_at``, with a lag."""
    made = scene()
    made.frozen_at, made.lag_s, made.reported = float("inf"), 0.0, []

    async def status() -> ControllerStatus:
        await made.rig.clock.sleep(0.001)
        if made.now < made.frozen_at:
            made.reported.append((made.now, str(made.rig.machine.pose())))
        shown = [pose for then, pose in made.reported if then <= made.now - made.lag_s]
        return ControllerStatus(estop=False, enabled=True, heartbeat=(shown or ["home"])[-1])

    made.controller.status = status
    return made


async def test_a_controller_that_freezes_during_a_move_stops_the_robot(stage) -> None:
    await stage.do(move(P1))
    stage.frozen_at = stage.now + 0.3
    with pytest.raises(GuardTripped, match=r"is frozen: .* although encoder") as tripped:
        await stage.do(move(V1))
    assert tripped.value.trip.guard is Guard.STALE
    assert stage.stops == 1
    assert stage.now - stage.frozen_at < 4 * STALE_S


@pytest.mark.parametrize("lag_s", [0.0, 0.02, 0.1])
async def test_a_controller_that_works_is_not_called_frozen_though_it_lags(stage, lag_s: float) -> None:
    stage.lag_s = lag_s
    for at in (P1, V1, P1):
        await stage.do(move(at))
    assert stage.stops == 0


async def test_encoders_that_lag_behind_the_controller_at_the_end_are_no_motion(stage) -> None:
    real = stage.rig.bench.encoders.read

    async def late() -> EncoderSample:
        sample: EncoderSample = await real()
        await stage.rig.clock.sleep(0.08)
        return sample

    stage.rig.bench.encoders.read = late
    for at in (P1, V1):
        await stage.do(move(at))
    assert stage.stops == 0
