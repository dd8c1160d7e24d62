"""Whether the geometry of a mechanism is found from records without noise."""

from __future__ import annotations

import numpy as np

from hexacell.conformance.example import MechanismExample
from hexacell.identification.estimator import identify
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.identification.problem.prior import Noise, Prior
from hexacell.identification.problem.problem import Assumptions
from hexacell.identification.solver.fit import RELEASE_RATIO
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record, deviation_of, joints_of

NOISE = Noise(1e-5, 1e-5)
"""Stated, mm; the records have none."""

LARGEST_ERROR = 1e-6
"""Of any parameter, mm or rad."""


def check_identification(example: MechanismExample) -> None:
    """A robot within the tolerances is identified from its records, commanded with the drawing."""
    _, truth, *_ = example.robots()
    normal, _ = example.mechanism.normalize_frames(truth)
    problem = Assumptions(
        example.mechanism,
        controller=CommandingGeometry.of(example.mechanism, example.drawing),
        branch=example.branch,
        prior=Prior.of(example.mechanism, example.drawing, example.widths),
        noise=NOISE,
    ).problem(records_without_noise(example, truth))
    found = identify(problem)
    # How large a machine is, records without noise seem to tell, and sigma says that they do not.
    if found.undetermined and not example.mechanism.frame_freedom.size:
        raise AssertionError(f"not determined: {', '.join(found.undetermined)}")
    unseen, error = _error(found, example.mechanism.convention.free_parameters(normal))
    if unseen != example.mechanism.frame_freedom.size:
        raise AssertionError(f"the records leave {unseen} directions to the tolerances")
    if not error < LARGEST_ERROR:
        raise AssertionError(f"the identified geometry is {error:.1e} off")


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
    for row, (point, orientation) in enumerate(example.labels()):
        if actual.found[row]:
            deviation = deviation_of(balls[row] - zeros.setdefault(point, balls[row]))
            pose = example.poses.pose(row)
            records.append(Record(point, orientation, pose, joints_of(joints[row]), deviation))
    if 2 * len(records) < len(balls):
        raise AssertionError("the robot cannot take most of the drawing's poses")
    return MeasurementSet(tuple(records))
