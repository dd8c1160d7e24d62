"""Data that cannot identify a geometry, whatever they say: what is missing, and what would supply it."""

from __future__ import annotations

import numpy as np

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem.problem import Problem
from hexacell.kinematics import rotations
from hexacell.kinematics.rotations import Array

SAME_AXIS = 0.02
"""Of the largest turns: below that, turns about other axes are not meant as such."""

TURNED = 1e-3
"""rad, root mean square: below that, the platform was not turned."""

POSES_WORTH_COUNTING = 1000
"""With more records, there are enough different ones among them."""


def equations(problem: Problem) -> int:
    """Three for each different pose, less three for each point's unknown reference."""
    return 3 * (_poses(problem) - problem.points)


def is_determined(problem: Problem) -> bool:
    """Whether there are as many equations as parameters, from two points at least."""
    return problem.points >= 2 and equations(problem) >= len(problem.prior.covariance)


def require_enough_records(problem: Problem) -> None:
    """Raise where the number of records or points, or their poses, show that nothing can be identified.

    Raises:
        IdentifiabilityError: says what is missing, and what measurement would supply it.
    """
    parameters = len(problem.prior.covariance)
    if problem.points < 2:
        raise IdentifiabilityError(
            f"records at one point cannot determine the {parameters} parameters, however many they are",
            action="Measure at two points at least",
        )
    found = equations(problem)
    if found < parameters:
        missing = -(-(parameters - found) // 3)
        repeated = problem.records - _poses(problem)
        but = f", {repeated} of them of a pose measured before," if repeated else ""
        raise IdentifiabilityError(
            f"{problem.records} records at {problem.points} points{but} give {found} equations for "
            f"{parameters} parameters",
            action=f"Measure {missing} more records at these points",
        )


def require_rotation_diversity(problem: Problem) -> None:
    """Raise where the commanded orientations of all points differ by turns about a single axis.

    Raises:
        IdentifiabilityError: names the axis, and the turns that are missing.
    """
    turns = _turns(problem)
    squares, axes = np.linalg.eigh(turns.T @ turns)
    if squares[-1] < len(turns) * TURNED**2:
        raise IdentifiabilityError(
            "the platform stands in one orientation in all records of a point",
            action="Measure each point in orientations tilted about x and about y, and turned about z",
        )
    if squares[-2] < SAME_AXIS**2 * squares[-1]:
        axis, missing = _in_words(axes[:, -1])
        raise IdentifiabilityError(
            f"all orientations turn about {axis} only, and so they cannot determine all parameters",
            action=f"Measure orientations that {missing}",
        )


def _turns(problem: Problem) -> Array:
    """Rotation vectors (n, 3), rad, in the gauges' frame, from each point's first commanded orientation."""
    commanded = problem.commands.poses.rotations
    first = problem.per_record(commanded[problem.first_rows])
    return rotations.to_vector(commanded @ np.swapaxes(first, -1, -2)) @ problem.gauges


def _in_words(direction: Array) -> tuple[str, str]:
    ways = {"x": "tilt about x", "y": "tilt about y", "z": "turn about z"}
    nearest = int(np.argmax(np.abs(direction)))
    if np.abs(direction[nearest]) < np.cos(0.1):
        x, y, z = direction * np.sign(direction[nearest])
        return f"the axis ({x:.2f}, {y:.2f}, {z:.2f})", "turn about axes across it too"
    axis = "xyz"[nearest]
    return axis, " and ".join(way for name, way in ways.items() if name != axis) + " too"


def _poses(problem: Problem) -> int:
    """How many different poses were measured."""
    if problem.records > POSES_WORTH_COUNTING:
        return problem.records
    poses = problem.commands.poses
    turned = poses.rotations.reshape(-1, 9)
    numbers = np.column_stack([problem.labels[:, 0], poses.positions, turned]).round(9)
    return len(np.unique(numbers, axis=0))
