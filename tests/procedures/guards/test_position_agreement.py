"""Reported pose, reported joints and encoders: whether they agree, and which one is odd."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
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
    return position_mismatch(Hexaglide(), geometry or ROBOT.controller, ROBOT.branch, reports, **TOLERANCES)


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


def test_the_pose_of_home_is_odd_where_joints_and_encoders_agree() -> None:
    found = mismatch(reports(pose=HOME))
    assert found is not None
    assert found.odd is PositionSource.POSE
    assert not found.is_pose_near
    leg = found.leg - 1
    assert found.by_pose == pytest.approx(joints_at(HOME)[leg])
    assert found.joint == pytest.approx(joints_at(THERE)[leg], abs=1e-6)


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
    found = position_mismatch(Hexaglide(), ROBOT.controller, branch, reports(), **TOLERANCES)
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


def test_joints_of_home_are_odd_where_pose_and_encoders_agree() -> None:
    found = mismatch(reports(joints=joints_at(HOME)))
    assert found is not None
    assert found.odd is PositionSource.JOINTS


def test_where_no_two_agree_nothing_is_named() -> None:
    found = mismatch(reports(pose=HOME, joints=joints_at(THERE) + 30.0))
    assert found is not None
    assert found.odd is None


def test_without_joints_nothing_is_named() -> None:
    found = mismatch(reports(pose=HOME, joints=None))
    assert found is not None
    assert (found.odd, found.joint) == (None, None)


def test_a_pose_out_of_reach_is_odd() -> None:
    found = mismatch(reports(pose=Pose(0.0, 0.0, 2000.0)))
    assert found is not None
    assert (found.odd, found.by_pose, found.is_pose_near) == (PositionSource.POSE, None, False)


def test_a_servo_that_trembles_by_its_tolerance_is_no_mismatch() -> None:
    assert mismatch(reports(joints=joints_at(THERE) + 0.009)) is None
