"""Cranks: known angles, frames, the size that nothing measures, and joints that turn with the crank."""

from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.errors import UsageError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.mechanisms.rotary_cranks import ROTARY_CRANKS_PARAMETERS, RotaryCranks
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import turns_of
from hexacell.robot.model import robot_of
from tests.geometries import rotary_cranks_geometry

MECHANISM = RotaryCranks()
CELL = Path(__file__).parents[4] / "configs" / "rotary-cranks.toml"
BRANCH: Branch = (-1, -1, -1, -1, -1, -1)
POSES = PoseBatch.of([Pose(20, -30, 610, 5, -8, 3), Pose(-40, 10, 560, -3, 4, -6)])


@pytest.fixture(scope="module")
def drawing() -> Geometry:
    return robot_of(load_cell(CELL)).drawing


def single(angle_deg: float) -> Geometry:
    """All cranks alike: about -y at the origin, level and along x at 0, each rod straight above its end."""
    axis = turns_of(np.array([0.0, -1.0, 0.0]))
    end = 100.0 * np.array([np.cos(np.radians(angle_deg)), 0.0, np.sin(np.radians(angle_deg))])
    platform = np.tile(end + np.array([0.0, 0.0, 300.0]), (6, 1))
    return rotary_cranks_geometry(
        np.zeros((6, 3)), np.tile(axis, (6, 1)), [100.0] * 6, [X_STAYS] * 6, platform, [300.0] * 6
    )


X_STAYS = 0.0
"""The turn that puts z to -y is about x, and leaves x where it is."""


@pytest.mark.parametrize("angle_deg", [-20.0, 0.0, 35.0])
def test_an_angle_is_that_of_the_crank_in_degrees(angle_deg: float) -> None:
    """About -y a crank along x turns upward."""
    at_origin = PoseBatch.at(np.zeros((1, 3)), np.eye(3)[None])
    both = [MECHANISM.inverse(single(angle_deg), (s,) * 6, at_origin)[0, 0] for s in (-1, 1)]
    assert min(abs(found - angle_deg) for found in both) < 1e-9


def test_an_axis_that_points_down_is_refused(drawing: Geometry) -> None:
    values = drawing.document()
    values["axis"][3] = turns_of(np.array([0.0, 0.001, -1.0])).tolist()
    with pytest.raises(UsageError, match="the axis of a motor points downward"):
        MECHANISM.normalize_frames(Geometry.of(ROTARY_CRANKS_PARAMETERS, values))


def test_joints_at_the_base_turn_with_their_cranks(drawing: Geometry) -> None:
    """The direction of a rod is seen from its crank, along which the frame's x axis is."""
    joints = MECHANISM.inverse(drawing, BRANCH, POSES)
    legs = MECHANISM.legs(drawing, POSES, joints)
    assert legs.carriers is not None
    arms = (legs.base_joints - drawing["centre"]) / drawing["crank"][:, None]
    np.testing.assert_allclose(legs.carriers[..., 0], arms, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(legs.carriers), 1.0, atol=1e-9)
    cosines = np.einsum("nij,nij->ni", arms, legs.directions)
    np.testing.assert_allclose(legs.in_carriers(legs.directions)[..., 0], cosines, atol=1e-9)
