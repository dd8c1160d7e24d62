"""Legs that are screws: their correction against its formula, leg by leg, and in every choice of frames."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.loader import load_cell
from hexacell.conformance import MechanismConformance, MechanismExample
from hexacell.conformance.frame_checks import LEAST_DETERMINED, _by_parameters
from hexacell.kinematics.forward import apply_twist
from hexacell.kinematics.mechanisms.gough_stewart import GoughStewart, ScrewLegs
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import robot_of

LEAD_MM = 10.0
LARGEST_CHANGE = LEAD_MM / (2.0 * np.pi * 500.0)
"""Of a leg's length by a motion across it, of 1 mm: no leg is shorter than 500 mm."""

ROBOT = robot_of(CELL := load_cell(Path(__file__).parents[4] / "configs" / "gough-stewart.toml"))
AROUND = np.radians(60.0 * np.arange(6.0))
BASE_AXES = np.stack([-np.sin(AROUND), np.cos(AROUND), 0.1 * np.ones(6)], axis=-1)
PLATFORM_AXES = np.stack([np.cos(AROUND), 2.0 * np.sin(AROUND), 0.3 * np.sin(2.0 * AROUND)], axis=-1)
MECHANISM = ScrewLegs(LEAD_MM, BASE_AXES, PLATFORM_AXES, ROBOT.drawing)
degrees = st.floats(-30.0, 30.0)
poses = st.builds(
    Pose, st.floats(-100, 100), st.floats(-100, 100), st.floats(700, 850), degrees, degrees, degrees
)


class TestConformance(MechanismConformance):
    example = MechanismExample(
        MECHANISM,
        ROBOT.drawing,
        (),
        np.array(CELL.settings.identification.points),
        ROBOT.tolerances.by_kind,
    )

    def test_constraints_are_lengths(self) -> None:
        """But for what the screw adds when the leg swings."""
        example = self.example
        joints = example.joints(example.drawing)
        pose = example.mechanism.derivatives(example.drawing, example.poses, joints).pose
        size = np.linalg.norm(pose[..., :3], axis=-1)
        np.testing.assert_allclose(size, 1.0, atol=LARGEST_CHANGE)

    def test_derivatives_are_those_of_the_constraints(self) -> None:
        """By the free parameters in the convention's frames, where none turns the axes; and by the pose."""
        example, convention = self.example, MECHANISM.convention
        for built in example.robots():
            geometry, change = MECHANISM.normalize_frames(built)
            at = change.poses(example.poses)
            joints = example.joints(geometry, at)
            at = apply_twist(at, np.random.default_rng(3).uniform(-1e-3, 1e-3, (len(at), 6)))
            found = MECHANISM.derivatives(geometry, at, joints)
            free = convention.free_parameters(geometry)

            def by_parameters(step: Array, free: Array = free, at=at, joints=joints) -> Array:
                changed = convention.geometry(free + step)
                return MECHANISM.residual_and_jacobian(changed, at, joints)[0]

            def by_twist(step: Array, geometry=geometry, at=at, joints=joints) -> Array:
                twisted = apply_twist(at, np.tile(step, (len(at), 1)))
                return MECHANISM.residual_and_jacobian(geometry, twisted, joints)[0]

            of_own = MECHANISM.parameters.by_constraint(np.eye(len(MECHANISM.parameters)))
            all_of_them = np.einsum("nic,icp->nip", found.parameters, of_own)
            compare(all_of_them @ convention.basis, by_parameters, np.full(len(free), 1e-3))
            compare(found.pose, by_twist, np.repeat([1e-3, 1e-6], 3))

    def test_the_free_parameters_are_those_that_poses_determine(self) -> None:
        """The others are derived as if their joints took no axes with them, so they tell nothing."""
        sizes = _by_parameters(self.example, MECHANISM.convention.basis)
        assert sizes[-1] > LEAST_DETERMINED * sizes[0]


def compare(told: Array, residual, steps: Array) -> None:
    for column, step in enumerate(np.diag(steps)):
        differences = (residual(step) - residual(-step)) / (2.0 * steps[column])
        limit = 1e-6 * max(1.0, float(np.abs(differences).max()))
        np.testing.assert_allclose(told[..., column], differences, rtol=0.0, atol=limit)


@given(poses)
def test_each_leg_is_corrected_by_its_formula(pose: Pose) -> None:
    batch, geometry = PoseBatch.of([pose]), ROBOT.drawing
    joints = MECHANISM.inverse(geometry, (), batch)[0]
    for leg in range(6):
        rotation = batch.rotations[0]
        vector = batch.positions[0] + rotation @ geometry["platform"][leg] - geometry["base"][leg]
        u = vector / np.linalg.norm(vector)
        on_base = np.cross(u, np.cross(BASE_AXES[leg], u))
        on_platform = np.cross(rotation @ PLATFORM_AXES[leg], u)
        cosine = on_base @ on_platform / (np.linalg.norm(on_base) * np.linalg.norm(on_platform))
        added = LEAD_MM * np.arcsin(cosine) / (2.0 * np.pi)
        expected = np.linalg.norm(vector) + added - geometry["offset"][leg]
        assert joints[leg] == pytest.approx(expected, abs=1e-9)


def test_without_a_lead_it_is_the_platform_itself() -> None:
    without = ScrewLegs(0.0, BASE_AXES, PLATFORM_AXES, ROBOT.drawing)
    batch = PoseBatch.of([Pose(10.0, 20.0, 780.0, 5.0, -10.0, 15.0)])
    np.testing.assert_array_equal(
        without.inverse(ROBOT.drawing, (), batch), GoughStewart().inverse(ROBOT.drawing, (), batch)
    )
