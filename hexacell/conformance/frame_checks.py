"""Whether the frame convention of a mechanism removes exactly what the choice of frames explains."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from hexacell.conformance.example import TURNS, MechanismExample
from hexacell.identification.diagnostics.frame_alignment import frame_derivatives
from hexacell.identification.estimator import identify
from hexacell.identification.placement import Placement
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.identification.problem.prior import Noise, Prior
from hexacell.identification.problem.problem import Assumptions
from hexacell.identification.solver.fit import RELEASE_RATIO
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record, deviation_of, joints_of

ROUNDING = 1e-8
LEAST_DETERMINED = 1e-7
"""Share of the largest singular value: what is smaller is not determined at all."""

NOISE = Noise(1e-5, 1e-5)
"""Stated noise, mm; the records are exact."""

LARGEST_ERROR = 1e-6
"""Largest error of a parameter, mm or rad."""


class FrameTests:
    """The frames take what they explain, the records determine the rest."""

    example: ClassVar[MechanismExample]

    def test_the_rules_take_as_many_numbers_as_the_frames_are_free(self) -> None:
        """The rules name parameters of the mechanism, each once, and leave what the frames do not take."""
        example = self.example
        convention, parameters = example.mechanism.convention, example.mechanism.parameters
        ruled = [*convention.zero, *(name for group in convention.equal for name in group)]
        assert set(ruled) <= set(parameters.names), "a rule names no parameter"
        assert len(set(ruled)) == len(ruled), "a rule names a parameter that another rule names"
        fixed, ways = len(parameters) - len(convention.free_names), example.mechanism.frame_freedom.columns
        assert fixed == len(ways), f"the rules fix {fixed} numbers, frames change in {len(ways)} ways"

    def test_the_convention_is_idempotent(self) -> None:
        """The convention's frames satisfy its rules exactly, and are found again from any others."""
        example = self.example
        mechanism = example.mechanism
        for geometry in example.robots():
            normal, _ = mechanism.normalize_frames(geometry)
            convention = mechanism.convention
            exact = convention.geometry(convention.free_parameters(normal))
            np.testing.assert_array_equal(normal.vector, exact.vector, "the rules hold only nearly")
            again, change = mechanism.normalize_frames(normal)
            np.testing.assert_allclose(
                again.vector, normal.vector, atol=ROUNDING, err_msg="normalized twice"
            )
            for turn in (change.base, change.platform):
                np.testing.assert_allclose(turn, np.eye(3), atol=ROUNDING)
            np.testing.assert_allclose(change.origin, 0.0, atol=ROUNDING)
            for other in example.changes_of_frames():
                found, _ = mechanism.normalize_frames(mechanism.change_frames(geometry, other))
                np.testing.assert_allclose(found.vector, normal.vector, atol=ROUNDING, err_msg=str(other))

    def test_changes_of_frames_change_no_machine(self) -> None:
        """A machine in other frames has the same joint variables at the same poses."""
        example = self.example
        mechanism = example.mechanism
        for geometry in example.robots():
            poses = mechanism.completed(geometry, example.poses)
            expected = example.joints(geometry, poses)
            normal, to_normal = mechanism.normalize_frames(geometry)
            found = example.joints(normal, to_normal.poses(poses))
            np.testing.assert_allclose(found, expected, atol=ROUNDING, err_msg="in the convention's frames")
            for change in example.changes_of_frames():
                changed = mechanism.change_frames(geometry, change)
                found = example.joints(changed, change.poses(poses))
                np.testing.assert_allclose(found, expected, atol=ROUNDING, err_msg=str(change))
                back = mechanism.change_frames(changed, change.inverse())
                np.testing.assert_allclose(back.vector, geometry.vector, atol=ROUNDING)

    def test_the_free_parameters_are_those_that_poses_determine(self) -> None:
        """The poses determine every free parameter, and no more than those, whatever frames are chosen."""
        example = self.example
        convention = example.mechanism.convention
        all_together = _by_parameters(example, np.eye(len(example.mechanism.parameters)))
        free = _by_parameters(example, convention.basis)
        rank = int(np.sum(all_together > LEAST_DETERMINED * all_together[0]))
        determined = len(free) - example.mechanism.frame_freedom.size
        size = ", one of them the size" if example.mechanism.frame_freedom.size else ""
        words = f"the poses determine {rank} parameters, the convention leaves {len(free)} free{size}"
        assert rank == determined, words
        least = free[determined - 1] / free[0]
        assert least >= LEAST_DETERMINED, f"a free parameter is not determined: {least:.1e}"

    def test_exact_records_are_identified(self) -> None:
        """A robot within the tolerances is identified from its records, commanded with the drawing."""
        example = self.example
        _, truth, *_ = example.robots()
        normal, _ = example.mechanism.normalize_frames(truth)
        problem = Assumptions(
            example.mechanism,
            controller=CommandingGeometry.of(example.mechanism, example.drawing),
            branch=example.branch,
            prior=Prior.of(example.mechanism, example.drawing, example.widths),
            noise=replace(NOISE, joint_count=example.mechanism.joint_count),
        ).problem(records_without_noise(example, truth))
        found = identify(problem)
        # How large a machine is, records without noise seem to show, and sigma says that they do not.
        size = example.mechanism.frame_freedom.size
        assert size or not found.undetermined, f"not determined: {', '.join(found.undetermined)}"
        unseen, error = _error(found, example.mechanism.convention.free_parameters(normal))
        assert unseen == size, f"the records leave {unseen} directions to the tolerances"
        assert error < LARGEST_ERROR, f"the identified geometry is {error:.1e} off"


def _by_parameters(example: MechanismExample, basis: Array) -> Array:
    """Singular values of the poses by parameters, less what changes of the frames and of the size explain.

    Parameters are in units of their tolerances, rotations times the platform's radius.
    """
    mechanism, geometry = example.mechanism, example.mechanism.normalize_frames(example.drawing)[0]
    poses = mechanism.normalize_frames(example.drawing)[1].poses(example.poses)
    joints = example.joints(geometry, poses)
    weights = np.repeat([1.0, float(mechanism.platform_radius(geometry))], 3)[:, None]
    widths = example.widths.widths(mechanism.parameters)
    columns = Placement(mechanism, geometry, poses, joints).by_parameters(widths[:, None] * basis)
    columns = (weights * columns).reshape(-1, basis.shape[1])
    unseen = frame_derivatives(poses)
    if mechanism.frame_freedom.size:
        larger = np.concatenate([poses.positions, np.zeros((len(poses), 3))], axis=-1)
        unseen = np.concatenate([unseen, larger[..., None]], axis=-1)
    frames, _ = np.linalg.qr((weights * unseen).reshape(-1, unseen.shape[-1]))
    return np.linalg.svd(columns - frames @ (frames.T @ columns), compute_uv=False)


def _error(found: Identification, truth: Array) -> tuple[int, float]:
    """In how many directions the tolerances alone decide, and the largest error beside those."""
    factor = np.linalg.cholesky(found.problem.prior.covariance)
    ratios, directions = np.linalg.eigh(factor.T @ found.solution.information @ factor)
    seen = directions[:, ratios > RELEASE_RATIO]
    error = factor @ seen @ seen.T @ np.linalg.solve(factor, found.free - truth)
    return len(ratios) - seen.shape[1], float(np.abs(error).max())


def records_without_noise(example: MechanismExample, truth: Geometry) -> MeasurementSet:
    """The records of a robot that is commanded with the drawing, at those poses that it can take.

    The gauges have the travel that they need. Their axes are those of the drawing, once both robots are in
    the convention's frames.
    """
    mechanism = example.mechanism
    normal, _ = mechanism.normalize_frames(truth)
    drawn, frames = mechanism.normalize_frames(example.drawing)
    commands = frames.poses(example.poses)
    joints = example.joints(drawn, commands)
    actual = continue_solution(
        mechanism, normal, joints, start=commands, start_geometry=drawn, start_joints=joints
    )
    balls, zeros, records = actual.poses.positions @ frames.base, dict[int, Array](), []
    for row in np.flatnonzero(actual.found).tolist():
        point, turn = divmod(row, TURNS)
        deviation = deviation_of(balls[row] - zeros.setdefault(point, balls[row]))
        pose = example.poses.pose(row)
        records.append(Record(1 + point, 1 + turn, pose, joints_of(joints[row]), deviation))
    assert 2 * len(records) >= len(balls), "the robot cannot take most of the drawing's poses"
    return MeasurementSet(tuple(records))
