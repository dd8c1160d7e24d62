"""Data requirements: are there enough records, points and rotations to identify a geometry?"""

from __future__ import annotations

import numpy as np

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem.problem import Problem
from hexacell.kinematics import rotations
from hexacell.kinematics.rotations import Array

SAME_AXIS_RATIO = 0.02
"""Rotations about other axes below this share of the largest ones are not intended."""

SMALLEST_ROTATION = 1e-3
"""rad, root mean square; below it the platform counts as not rotated."""


def require_enough_records(problem: Problem) -> None:
    """Require enough points and different poses to determine the parameters.

    Raises:
        IdentifiabilityError: names what is missing, and what to measure.
    """
    parameters = problem.unknowns or len(problem.prior.covariance)
    if problem.points < 2:
        raise IdentifiabilityError(
            f"records at one point cannot determine the {parameters} parameters, whatever their number",
            action="Measure at two points at least",
        )
    found = problem.equations
    if found < parameters:
        missing = -(-(parameters - found) // 3)
        repeated = problem.records - problem.different_poses
        repeats = f", {repeated} of them of a pose measured before," if repeated else ""
        raise IdentifiabilityError(
            f"{problem.records} records at {problem.points} points{repeats} give {found} equations for "
            f"{parameters} parameters",
            action=f"Measure {missing} more records at these points",
        )


def require_rotation_diversity(problem: Problem) -> None:
    """Require that the orientations at the points differ by rotations about more than one axis.

    The principal axes are the eigenvectors of the rotation vectors' second moment.

    Raises:
        IdentifiabilityError: names the axis, and the rotations that are missing.
    """
    commanded = problem.commands.poses.rotations
    first = problem.per_record(commanded[problem.first_rows])
    # In the gauges' frame, from each point's first commanded orientation, rad.
    rotation_vectors = rotations.to_vector(commanded @ np.swapaxes(first, -1, -2)) @ problem.gauges
    squares, axes = np.linalg.eigh(rotation_vectors.T @ rotation_vectors)
    if squares[-1] < len(rotation_vectors) * SMALLEST_ROTATION**2:
        raise IdentifiabilityError(
            "the platform has one orientation in all records of a point",
            action="Measure each point in orientations tilted about x and about y, and turned about z",
        )
    if squares[-2] < SAME_AXIS_RATIO**2 * squares[-1]:
        axis, missing = _axis_and_missing(axes[:, -1])
        raise IdentifiabilityError(
            f"all orientations turn about {axis} only, and so they cannot determine all parameters",
            action=f"Measure orientations that {missing}",
        )


def _axis_and_missing(direction: Array) -> tuple[str, str]:
    rotations_about = {"x": "tilt about x", "y": "tilt about y", "z": "turn about z"}
    nearest = int(np.argmax(np.abs(direction)))
    if np.abs(direction[nearest]) < np.cos(0.1):
        x, y, z = direction * np.sign(direction[nearest])
        return f"the axis ({x:.2f}, {y:.2f}, {z:.2f})", "turn about axes across it too"
    axis = "xyz"[nearest]
    return axis, " and ".join(
        rotation for name, rotation in rotations_about.items() if name != axis
    ) + " too"
