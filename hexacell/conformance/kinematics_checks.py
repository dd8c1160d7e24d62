"""Whether constraints, derivatives, inverse and forward kinematics of a mechanism agree."""

from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np

from hexacell.conformance.example import MechanismExample
from hexacell.kinematics.forward import apply_twist, continue_solution
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.parameters import JointUnit, ParameterUnit
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

ROUNDING = 1e-9
DIFFERENCES = 1e-6
"""Accuracy of central differences, relative to the largest derivative of the same kind."""

STEPS = {ParameterUnit.MM: 1e-3, ParameterUnit.RAD: 1e-6, ParameterUnit.DEG: 1e-4, ParameterUnit.NONE: 1e-6}
JOINT_STEPS = {JointUnit.MM: 1e-3, JointUnit.DEG: 1e-4}
TWIST_STEPS = np.repeat([STEPS[ParameterUnit.MM], STEPS[ParameterUnit.RAD]], 3)
OFF = np.repeat([3.0, 0.01], 3)
"""A twist, mm and rad, after which the legs do not close: derivatives must hold there too."""

FAR_MM = 1e5


class KinematicsTests:
    """Constraints, derivatives, inverse and forward kinematics agree."""

    example: ClassVar[MechanismExample]

    def test_the_inverse_closes_every_leg(self) -> None:
        """The inverse closes every leg, is on its branch, and gives NaN or a number anywhere."""
        example = self.example
        mechanism = example.mechanism
        for geometry, poses, joints in example.robots_in_reach():
            residual = mechanism.residual_and_jacobian(geometry, poses, joints)[0]
            np.testing.assert_allclose(residual, 0.0, atol=ROUNDING, err_msg="the inverse leaves legs open")
            sides = np.array(example.branch or (1,) * mechanism.joint_count)
            found = mechanism.branch(geometry, poses, joints)
            expected = np.broadcast_to(sides, found.shape)
            np.testing.assert_array_equal(found, expected, "branch of the inverse")
        far = PoseBatch.at(np.full(3, FAR_MM), example.poses.rotations)
        with np.errstate(all="raise"):
            mechanism.inverse(example.drawing, example.branch, far)

    def test_constraints_are_lengths(self) -> None:
        """A leg's constraint is its error in mm: where it closes, a motion along the leg counts fully."""
        example = self.example
        joints = example.joints(example.drawing)
        pose = example.mechanism.derivatives(example.drawing, example.poses, joints).pose
        size = np.linalg.norm(pose[:, : example.mechanism.joint_count, :3], axis=-1)
        np.testing.assert_allclose(size, 1.0, atol=ROUNDING, err_msg="derivatives by the ball's position")

    def test_derivatives_are_those_of_the_constraints(self) -> None:
        """All derivatives are those of the constraints (central differences), off closed poses too."""
        example = self.example
        for geometry, poses, joints in example.robots_in_reach():
            off = OFF * np.random.default_rng(3).uniform(-1.0, 1.0, (len(poses), 6))
            _check_derivatives_at(example, geometry, apply_twist(poses, off), joints)

    def test_encoder_zeros_are_changes_of_parameters(self) -> None:
        """A leg with another zero closes with as much less on its encoder; no other leg changes."""
        example = self.example
        mechanism = example.mechanism
        for geometry, poses, joints in example.robots_in_reach():
            zeros = mechanism.encoder_zeros(geometry)
            for leg, one in enumerate(np.eye(mechanism.joint_count)):
                changed = Geometry(mechanism.parameters, geometry.vector + zeros[:, leg])
                left = mechanism.residual_and_jacobian(changed, poses, joints - one)[0]
                words = f"encoder zero of leg {leg + 1}"
                np.testing.assert_allclose(left, 0.0, atol=ROUNDING, err_msg=words)

    def test_forward_and_inverse_agree(self) -> None:
        """Forward kinematics from the drawing's pose leads back to where the inverse sends the robot."""
        example = self.example
        for geometry, poses, joints in example.robots_in_reach():
            found = continue_solution(
                example.mechanism,
                geometry,
                joints,
                start=poses,
                start_geometry=example.drawing,
                start_joints=example.joints(example.drawing, poses),
            )
            words = "forward kinematics finds no pose within the tolerances of the drawing"
            assert found.found.all(), words
            np.testing.assert_allclose(found.poses.positions, poses.positions, atol=1e-6)
            np.testing.assert_allclose(found.poses.rotations, poses.rotations, atol=1e-8)

    def test_batches_of_geometries(self) -> None:
        """One geometry for each pose gives what each gives alone."""
        example = self.example
        mechanism, robots = example.mechanism, list(example.robots())
        rows = np.arange(len(robots))
        poses, joints = example.poses[rows], example.joints(example.drawing)[rows]
        batch = GeometryBatch(mechanism.parameters, np.stack([one.vector for one in robots]))
        together = mechanism.residual_and_jacobian(batch, poses, joints)
        legs, radii = mechanism.legs(batch, poses, joints), mechanism.platform_radius(batch)
        for row, geometry in enumerate(robots):
            at = [row]
            alone = mechanism.residual_and_jacobian(geometry, poses[at], joints[at])
            for found, expected in zip(together, alone, strict=True):
                np.testing.assert_allclose(found[row], expected[0], atol=ROUNDING)
            own = mechanism.legs(geometry, poses[at], joints[at])
            np.testing.assert_allclose(legs.base_joints[row], own.base_joints[0], atol=ROUNDING)
            np.testing.assert_allclose(legs.platform_joints[row], own.platform_joints[0], atol=ROUNDING)
            np.testing.assert_allclose(radii[row], mechanism.platform_radius(geometry), atol=ROUNDING)

    def test_legs_in_space(self) -> None:
        """Platform joints are fixed to the platform, their mean distance from the ball is its radius."""
        example = self.example
        mechanism, poses = example.mechanism, example.poses
        legs = mechanism.legs(example.drawing, poses, example.joints(example.drawing))
        own = np.einsum("nij,nki->nkj", poses.rotations, legs.platform_joints - poses.positions[:, None])
        np.testing.assert_allclose(own, np.broadcast_to(own[0], own.shape), atol=ROUNDING)
        radius = np.linalg.norm(own[0], axis=-1).mean()
        np.testing.assert_allclose(mechanism.platform_radius(example.drawing), radius, atol=ROUNDING)
        has_guides = mechanism.guides(example.drawing, poses, example.joints(example.drawing)) is not None
        words = "a mechanism has a word for its guides exactly if it has guides"
        assert has_guides == (mechanism.words.guide is not None), words


def _check_derivatives_at(
    example: MechanismExample, geometry: Geometry, poses: PoseBatch, joints: Array
) -> None:
    mechanism, parameters = example.mechanism, example.mechanism.parameters
    found = mechanism.derivatives(geometry, poses, joints)
    jacobian = mechanism.residual_and_jacobian(geometry, poses, joints)[1]
    np.testing.assert_allclose(found.pose, jacobian, atol=ROUNDING, err_msg="the two pose Jacobians")

    def by_twist(step: Array) -> Array:
        twisted = apply_twist(poses, np.tile(step, (len(poses), 1)))
        return mechanism.residual_and_jacobian(geometry, twisted, joints)[0]

    def by_joints(step: Array) -> Array:
        return mechanism.residual_and_jacobian(geometry, poses, joints + step)[0]

    def by_parameters(step: Array) -> Array:
        changed = Geometry(parameters, geometry.vector + step)
        return mechanism.residual_and_jacobian(changed, poses, joints)[0]

    sizes = np.array([STEPS[parameter.kind.unit] for parameter in parameters.parameters])
    _compare(found.pose, by_twist, TWIST_STEPS, [f"pose {column}" for column in range(1, 7)])
    legs = mechanism.joint_count
    of_each_joint = np.zeros((len(poses), 6, legs))
    of_each_joint[:, np.arange(legs), np.arange(legs)] = found.joints
    steps = np.full(legs, JOINT_STEPS[mechanism.words.joint_unit])
    _compare(of_each_joint, by_joints, steps, ["joints"] * legs)
    # A constraint depends on its own numbers alone.
    of_own = parameters.by_constraint(np.eye(len(parameters)))
    of_all = np.einsum("nic,icp->nip", found.parameters, of_own)
    _compare(of_all, by_parameters, sizes, parameters.names)


def _compare(found: Array, residual: Callable[[Array], Array], steps: Array, names: Sequence[str]) -> None:
    """Derivatives (n, 6, k) with central differences by each of k numbers."""
    for column, (step, name) in enumerate(zip(np.diag(steps), names, strict=True)):
        differences = (residual(step) - residual(-step)) / (2.0 * steps[column])
        limit = DIFFERENCES * max(1.0, float(np.abs(differences).max()))
        words = f"derivatives by {name}"
        np.testing.assert_allclose(found[..., column], differences, rtol=0.0, atol=limit, err_msg=words)
