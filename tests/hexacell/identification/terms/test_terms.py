"""What terms beside the geometry do to a pose, by the kinematics of altered legs and joints."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.placement import Placement, RecordPlacement, Weight, leg_forces
from hexacell.identification.terms.backlash import backlash
from hexacell.identification.terms.compliance import compliance
from hexacell.identification.terms.play import play
from hexacell.identification.terms.taken import TakenTerms
from hexacell.kinematics import rotations
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.robot.model import robot_of
from tests.benchmarks.machines import bundled

DOWN = np.array([0.0, 0.0, -1.0])
WEIGHT = Weight(DOWN)
CELLS = ("simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks")
SMALL_MM = 1e-4


@pytest.fixture(params=CELLS)
def placement(request) -> RecordPlacement:
    cell = bundled(request.param)
    robot = robot_of(cell)
    geometry = robot.mechanism.normalize_frames(robot.drawing)[0]
    turns = rotations.from_angles(np.random.default_rng(1).uniform(-0.15, 0.15, (20, 3)))
    point = np.array(cell.settings.identification.points[0][:3])
    poses = robot.frames.poses(PoseBatch.at(point, turns))
    joints = robot.mechanism.inverse(geometry, robot.branch, poses)
    directions = np.random.default_rng(2).choice([-1.0, 1.0], joints.shape)
    zeros = np.zeros((len(joints), 3))
    readings = joints, zeros, np.eye(3), directions, np.zeros_like(joints)
    return RecordPlacement(robot.mechanism, geometry, poses, *readings)


def moved_mm(placement: Placement, geometry: Geometry, joints: np.ndarray) -> np.ndarray:
    found = forward_kinematics(placement.mechanism, geometry, joints, placement.poses)
    assert found.found.all()
    return found.poses.positions - placement.poses.positions


def test_a_joint_lags_behind_its_encoder_on_either_side(placement):
    for leg, errors in enumerate(
        np.moveaxis(backlash(0.1).pose_errors(placement, placement.directions), 2, 0)
    ):
        lagging = placement.joints.copy()
        lagging[:, leg] -= 0.5 * SMALL_MM * placement.directions[:, leg]
        expected = moved_mm(placement, placement.geometry, lagging)
        np.testing.assert_allclose(SMALL_MM * errors[:, :3], expected, atol=1e-4 * SMALL_MM)


def test_a_leg_that_is_pulled_is_longer(placement):
    """A leg of another length, by the kinematics: of the side to which play puts it, and as it yields."""
    if "l" not in placement.geometry.parameters.slices:
        return  # its legs are the joints; that these sink is tested below
    forces = leg_forces(placement, WEIGHT)
    terms = (play(0.1, WEIGHT), 0.5 * np.sign(forces)), (compliance(0.3, 100.0, WEIGHT), 0.1 * forces)
    for term, longer in terms:
        every = term.pose_errors(placement, placement.directions)
        for leg in range(6):
            values = placement.geometry.vector.copy()
            values[placement.geometry.parameters.slices["l"]][leg] += SMALL_MM
            longer_leg = Geometry(placement.geometry.parameters, values)
            by_length = moved_mm(placement, longer_leg, placement.joints) / SMALL_MM
            np.testing.assert_allclose(every[:, :3, leg], by_length * longer[:, [leg]], atol=2e-3)


def test_the_platform_sinks_under_its_weight(placement):
    """Legs that yield to a weight let it down: it would do work otherwise, whatever the mechanism."""
    down = compliance(0.3, 100.0, WEIGHT).pose_errors(placement, placement.directions).sum(axis=-1)
    arms = _middle(placement) - placement.poses.positions
    let_down = down[:, :3] @ DOWN + np.einsum(
        "ni,ni->n", np.cross(down[:, 3:], arms), np.tile(DOWN, (20, 1))
    )
    assert (let_down > 0.0).all()


def _middle(placement: Placement) -> np.ndarray:
    legs = placement.mechanism.legs(placement.geometry, placement.poses, placement.joints)
    middle: np.ndarray = legs.platform_joints.mean(axis=1)
    return middle


def test_coefficients_share_a_part_and_have_their_own(placement):
    term = play(0.1, WEIGHT)
    assert term.spread @ term.spread.T == pytest.approx(0.01 * (np.ones((6, 6)) + np.eye(6)))
    known = np.arange(20) != 3
    taken = TakenTerms.of((term,), placement, known)
    assert taken.columns.shape == (20, 3, 7)
    assert not taken.columns[3].any()
    whole = TakenTerms.of((term,), placement, np.ones(20, dtype=bool))
    np.testing.assert_allclose(taken.columns[known], whole.columns[known])
    twice = replace(term, size=0.2)
    np.testing.assert_allclose(TakenTerms.of((twice,), placement, known).columns, 2.0 * taken.columns)
