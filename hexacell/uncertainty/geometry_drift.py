"""The drift of a geometry since it was identified, as a prior of new records.

A geometry that was identified with a covariance, and that may have changed since, is known with the sum
of two covariances. How much it changes is known only roughly: the drift's scale, a factor of its standard
deviation, is estimated from the new records by their marginal likelihood (empirical Bayes; Berger,
Statistical Decision Theory and Bayesian Analysis, 1985, section 3.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.prior import Prior, Tolerances
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.frame_derivatives import free_parameter_derivatives
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import ParameterUnit
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, eq=False)
class IdentifiedBefore:
    """A geometry that was identified some time ago.

    Attributes:
        geometry: in the mechanism's frame convention.
        covariance: of its free parameters then (p, p), mm^2.
        drift: covariance (p, p) of their changes since, mm^2, where the drift's scale is 1.
    """

    mechanism: Mechanism
    geometry: Geometry
    covariance: Array
    drift: Array

    def prior(self, scale: float) -> Prior:
        """What is known of the geometry now, with the drift ``scale`` times as large as usual."""
        free = self.mechanism.convention.free_parameters(self.geometry)
        return Prior(self.geometry, free, self.covariance + scale**2 * self.drift, is_estimate=True)


def drift_covariance(mechanism: Mechanism, geometry: Geometry, sigma: Array) -> Array:
    """Covariance (p, p) of the free parameters when all parameters change independently.

    Every parameter (P,) of the machine changes, with standard deviations ``sigma``, those that the frame
    convention fixes as well: the convention then moves the others. ``geometry`` is in that convention.
    """
    factor = sigma[:, None] * free_parameter_derivatives(mechanism, geometry)
    covariance: Array = factor.T @ factor
    return covariance


def drift_sigma(mechanism: Mechanism, sigma_mm: float, tolerances: Tolerances) -> Array:
    """Standard deviations (P,) of the drift, that of lengths being given.

    Of other parameters it is the same share of the tolerance as of the largest tolerance of a length.
    """
    parameters, widths = mechanism.parameters, tolerances.widths(mechanism.parameters)
    is_length = np.array([p.kind.unit is ParameterUnit.MM for p in parameters.parameters])
    share = sigma_mm / widths[is_length].max()
    return np.where(is_length, sigma_mm, share * widths)


def log_marginal_likelihood(found: Identification) -> float:
    """Of the records under the prior of their problem, but for a constant of the records.

    The integral over the parameters is Laplace's approximation at the estimate: half the sum of the
    squared residuals, the squared distance from the prior's centre, and ``log det(1 + C I)`` with the
    prior's covariance C and the information I of the records, all with a minus sign.
    """
    prior, information = found.problem.prior, found.solution.information
    squares = found.chi2 + prior.squared_distance(found.free)
    volume = np.linalg.slogdet(np.eye(len(information)) + prior.covariance @ information)[1]
    return -0.5 * float(squares + volume)
