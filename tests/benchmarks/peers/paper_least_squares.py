"""The paper's method as a MATLAB user writes it: lsqnonlin is scipy's trust region with finite differences.

Ordinary least squares of all differences between two records of a point (Abtahi et al. 2010, eq. 5 to 8);
forward kinematics by Newton from the commanded poses; the solver's own tolerances.
"""

from itertools import combinations

import numpy as np
from scipy.optimize import least_squares

from hexacell.kinematics.rotations import Array, from_vector
from tests.benchmarks.peers.robots import Records

NEWTON_STEPS = 20
CLOSED_MM = 1e-9
STEP = np.array(1e-6)
"""Of finite differences, relative: with scipy's own one it does not always converge."""
MOST_ITERATIONS = 97
"""MATLAB's own limit of 100 evaluations for each unknown, 36 of them for an iteration."""


def solve(records: Records) -> Array:
    """See the module."""
    pairs = [
        pair
        for point in np.unique(records.points)
        for pair in combinations(np.flatnonzero(records.points == point), 2)
    ]
    first, second = np.array(pairs).T

    def differences(free: Array) -> Array:
        left = _ball(records, records.basis @ free) - records.deviations
        differing: Array = left[first] - left[second]
        return differing.ravel()

    try:
        found = least_squares(
            differences, records.free, method="trf", diff_step=STEP, max_nfev=MOST_ITERATIONS
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        raise ArithmeticError(str(error)) from error
    if not found.success:
        raise ArithmeticError(found.message)
    geometry: Array = records.basis @ found.x
    return geometry


def _ball(records: Records, geometry: Array) -> Array:
    """Where the ball is (n, 3), by Newton on each pose."""
    S, B, lengths = geometry[:18].reshape(6, 3), geometry[18:36].reshape(6, 3), geometry[36:]
    positions, rotations = records.positions, records.rotations
    for _ in range(NEWTON_STEPS):
        arms = B @ np.swapaxes(rotations, 1, 2)
        legs = S - positions[:, None] - arms
        legs[..., 0] += records.joints
        error = 0.5 * (np.sum(legs**2, axis=2) - lengths**2)
        if np.abs(error).max() < CLOSED_MM * lengths.max():
            break
        jacobian = np.concatenate([-legs, -np.cross(arms, legs)], axis=2)
        step = -np.linalg.solve(jacobian, error[..., None])[..., 0]
        positions = positions + step[:, :3]
        rotations = from_vector(step[:, 3:]) @ rotations
    return positions
