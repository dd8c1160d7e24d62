"""Effects that depend on the mechanism, rails, discs, its own weight: what they do, and nothing falsely."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.identification.estimator import identify
from hexacell.identification.placement import Placement, Weight, leg_forces
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.gough_stewart import GoughStewart
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.robot.model import robot_of
from hexacell.uncertainty.effect_kinds import (
    common_sag,
    encoder_eccentricities,
    own_weight,
    rail_directions,
    rail_waves,
    temperature_at_work,
)
from hexacell.uncertainty.effects import Effect, Occurrence, errors_by_effects
from tests.geometries import gough_stewart_geometry
from tests.hexacell.altered_records import altered

STEP_MM = 1e-4
CONFIGS = Path(__file__).parents[3] / "configs"


@pytest.fixture(scope="module")
def hexapod() -> Placement:
    """A Gough-Stewart platform 420 mm above its base, tilted."""
    base, platform = np.radians([-50, 50, 70, 170, 190, 290]), np.radians([-10, 10, 110, 130, 230, 250])
    geometry = gough_stewart_geometry(
        base=np.stack([350 * np.cos(base), 350 * np.sin(base), np.zeros(6)], axis=1),
        platform=np.stack([160 * np.cos(platform), 160 * np.sin(platform), np.full(6, -30.0)], axis=1),
        offset=np.full(6, 500.0),
    )
    poses = PoseBatch.of([Pose(0.0, 0.0, 420.0, 10.0, 5.0, 0.0), Pose(40.0, -30.0, 450.0, 0.0, -12.0, 8.0)])
    joints = GoughStewart().inverse(geometry, (), poses)
    return Placement(GoughStewart(), geometry, poses, joints)


def columns(effect: Effect, placement: Placement) -> np.ndarray:
    assert effect.on_poses is not None
    return effect.on_poses(placement)


@pytest.mark.parametrize("effect", [rail_directions(1.0), rail_waves(1.0, 600.0), common_sag(1.0, 800.0)])
def test_a_mechanism_without_rails_has_no_effects_of_rails(hexapod, effect) -> None:
    assert columns(effect, hexapod).shape == (2, 6, 0)


def test_a_machine_that_expands_evenly_is_the_same_machine_larger(hexapod) -> None:
    """The platform moves away from the base's origin and does not turn; scales expand with the base."""
    even = temperature_at_work(1.0, dict.fromkeys(MachinePart, 10.0))
    warmer = columns(even, hexapod)[..., 0]
    assert warmer[:, :3] == pytest.approx(10e-6 * hexapod.poses.positions)
    assert warmer[:, 3:] == pytest.approx(0.0, abs=1e-15)


def test_a_slider_across_its_rail_moves_its_joint(paper, hexaglide) -> None:
    poses = PoseBatch.of([Pose(x, y, z, 5.0, -8.0, 3.0) for x, y, z in paper.points.tolist()])
    joints = hexaglide.inverse(paper.actual, paper.branch, poses)
    guides = hexaglide.guides(paper.actual, poses, joints)
    assert sorted(leg for rail in guides.rails for leg in rail) == list(range(6))
    assert guides.along == pytest.approx(joints + paper.actual["S"][:, 0])
    for direction in (1, 2):
        shift = STEP_MM * np.eye(3)[direction]
        ahead, behind = (
            hexaglide.residual_and_jacobian(moved(paper.actual, sign * shift), poses, joints)[0]
            for sign in (1.0, -1.0)
        )
        slope = (ahead - behind) / (2.0 * STEP_MM)
        assert guides.across[..., direction - 1] == pytest.approx(slope, abs=1e-8)


def moved(geometry: Geometry, shift: np.ndarray) -> Geometry:
    values = {"S": geometry["S"] + shift, "B": geometry["B"], "l": geometry["l"]}
    return Geometry.of(geometry.parameters, values)


def test_a_disc_off_centre_errs_by_a_sine_over_the_turn() -> None:
    """Of known phase it is a sum of its two causes; the pose follows the angle that is wrong by it."""
    robot = robot_of(load_cell(CONFIGS / "rotary-cranks.toml"))
    poses = PoseBatch.of([Pose(0.0, 0.0, 600.0, 10.0, 5.0, 0.0), Pose(40.0, -30.0, 560.0, 0.0, -12.0, 8.0)])
    joints = robot.mechanism.inverse(robot.drawing, robot.branch, poses)
    placement = Placement(robot.mechanism, robot.drawing, poses, joints)
    found = columns(encoder_eccentricities(1.0), placement)
    assert found.shape == (2, 6, 12)
    amplitude, leg, phase = 0.01, 2, 0.7
    share = np.sqrt(2.0) * amplitude / 1e-3 * np.array([np.cos(phase), np.sin(phase)])
    predicted = found[..., [leg, 6 + leg]] @ share
    wrong = joints.copy()
    wrong[:, leg] += amplitude * np.cos(np.radians(joints[:, leg]) - phase)
    moved = forward_kinematics(robot.mechanism, robot.drawing, wrong, poses)
    assert moved.found.all()
    np.testing.assert_allclose(
        moved.poses.positions - poses.positions, predicted[:, :3], rtol=2e-3, atol=1e-5
    )


DOWN = np.array([0.0, 0.0, -1.0])
CENTRE_MM = np.array([10.0, -5.0, -90.0])
NEWTON, UM_PER_N = 100.0, 0.08
"""A compliance at which the records of the paper's robot show it."""


@pytest.fixture(scope="module")
def placement(noisy, make_problem):
    found = identify(make_problem(noisy))
    return Placement(found.problem.mechanism, found.geometry, found.poses, found.problem.joints)


def test_the_legs_hold_the_weight_in_balance(placement):
    forces = leg_forces(placement, Weight(DOWN, CENTRE_MM))
    legs = placement.mechanism.legs(placement.geometry, placement.poses, placement.joints)
    # A leg that is pulled draws the platform towards its base.
    pulls = forces[..., None] * legs.directions
    arms = legs.platform_joints - placement.poses.positions[:, None, :]
    np.testing.assert_allclose(pulls.sum(axis=1), np.tile(-DOWN, (len(placement), 1)), atol=1e-9)
    moment = np.cross(placement.poses.rotations @ CENTRE_MM, -DOWN)
    np.testing.assert_allclose(np.cross(arms, pulls).sum(axis=1), moment, atol=1e-6)


def test_a_stated_weight_makes_no_healthy_machine_doubtful(noisy, make_problem, placement):
    """Without it the residuals are too large, and a person would look for a fault."""
    forces = NEWTON * leg_forces(placement, Weight(DOWN, CENTRE_MM))
    moved = np.einsum("nij,nj->ni", placement.by_constraints, 1e-3 * UM_PER_N * forces)[:, :3]
    rows = {record.id: row for row, record in enumerate(noisy.records)}
    loaded = altered(noisy, lambda r: {"deviation": np.array(r.deviation) + moved[rows[r.id]]})
    problem = make_problem(loaded)
    unstated = identify(problem)
    assert not unstated.goodness.is_explained
    for centre in (CENTRE_MM, None):
        effect = own_weight(NEWTON, UM_PER_N, Weight(DOWN, centre))
        assert effect.occurrence is Occurrence.CONSTANT
        stated = identify(replace(problem, systematic=partial(errors_by_effects, (effect,))))
        assert stated.goodness.is_explained
