"""Criteria of optimal experiment design: what a record would be worth.

A record with Jacobian H against its point's reference and covariance V changes the covariance C of the
parameters to ``C - C H^T S^-1 H C`` with the innovation covariance ``S = H C H^T + V`` (the Kalman
update), which is known before it is measured. Records are chosen one at a time, each the best beside
those taken (Fedorov, Theory of Optimal Experiments, 1972; Atkinson & Donev, Optimum Experimental Designs,
1992), for one of the criteria

- D: the volume of the confidence ellipsoid, ``log det C``;
- A: the sum of the variances of all parameters, ``tr C``, in mm and mrad;
- I: the mean variance of the position at the task poses, ``tr(J C J^T)``.
"""

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Criterion:
    """An optimality criterion: the ``weight`` (p, p) of the parameters' covariance; None for D.

    What else is unknown comes after the parameters, and has none.
    """

    weight: Array | None = None

    def gain(self, covariance: Array, jacobian: Array, noise: Array) -> Array:
        """What each of n records would gain (n,): nat for D, mm^2 for A and I.

        By the ``covariance`` (p, p) of the parameters, mm^2, the ``jacobian`` of the records (n, 3, p), and
        the covariance of their ``noise`` (n, 3, 3), mm^2.
        """
        total = innovation_covariance(covariance, jacobian, noise)
        if self.weight is None:
            return np.asarray(0.5 * (np.linalg.slogdet(total)[1] - np.linalg.slogdet(noise)[1]))
        weighted = covariance[: len(self.weight)]
        # tr(W C H^T S^-1 H C) is the sum of the products of S^-1 with H C W C H^T, both 3 x 3.
        removed = _quadratic_forms(weighted.T @ self.weight @ weighted, jacobian)
        return np.asarray(np.einsum("nij,nji->n", np.linalg.inv(total), removed))


D_OPTIMAL = Criterion()


def innovation_covariance(covariance: Array, jacobian: Array, noise: Array) -> Array:
    """Covariance S (n, 3, 3), mm^2, of n predicted deviations; arguments as of :meth:`Criterion.gain`."""
    return _quadratic_forms(covariance, jacobian) + noise


def _quadratic_forms(matrix: Array, jacobian: Array) -> Array:
    """``H M H^T`` (n, 3, 3) of each H (n, 3, p): one large product is faster than n small ones."""
    left = (jacobian.reshape(-1, jacobian.shape[-1]) @ matrix).reshape(jacobian.shape)
    return left @ np.swapaxes(jacobian, -1, -2)


def update_factors(covariance: Array, jacobian: Array, noise: Array) -> Array:
    """Factors F (n, 3, p): each of n records would change the covariance C to ``C - F^T F``."""
    root = np.linalg.cholesky(innovation_covariance(covariance, jacobian, noise))
    return np.linalg.solve(root, jacobian @ covariance)


def covariance_update(covariance: Array, jacobian: Array, noise: Array) -> Array:
    """A covariance (p, p) after one record of Jacobian (3, p) and covariance (3, 3)."""
    crossing = covariance @ jacobian.T
    after: Array = covariance - crossing @ np.linalg.solve(jacobian @ crossing + noise, crossing.T)
    return 0.5 * (after + after.T)


def add_information(covariance: Array, information: Array) -> Array:
    """A covariance (p, p) after records that add ``information`` (p, p), the inverse of a covariance."""
    after: Array = np.linalg.inv(np.linalg.inv(covariance) + information)
    return 0.5 * (after + after.T)
