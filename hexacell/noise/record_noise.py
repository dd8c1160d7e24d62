"""The noise that the records of a calibration show: repeatability, and the shares of encoders and gauges.

Repeatability is the scatter of deviations where the same pose was commanded more than once.

Variance components are estimated from the residuals. A record's covariance is ``V = s1 Q1 + s2 Q2``: the
variance s1 of the encoders, propagated through the machine, ``Q1 = Gq Gq^T``, and the variance s2 of the
gauges, ``Q2 = I``. They are separable because Gq changes from pose to pose and differs in x, y and z.
Restricted maximum likelihood (REML) requires for both

    r^T W Qk W r = tr(P Qk),    P = W - W X C X^T W,

with the residuals r, their weights W = V^-1, the Jacobian X of the unknowns and their covariance C. Only
the diagonal blocks of P are needed. The steps are Fisher scoring of the logarithms, so that the variances
stay positive. The information matrix is computed from the same blocks and scaled so that the total noise
has the standard error of its degrees of freedom; with 55 records that is within 5 % of the exact one.

Sources: Patterson and Thompson 1971; Horn, Horn and Duncan 1975 (the fixed point).
"""

from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.solver.linear_model import LinearizedModel
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, deviation_of

COMMAND_DIGITS = 6
"""Decimal digits, mm and deg, to which commands are compared."""
CONFIDENCE = 0.95

MAX_STEPS = 60
MAX_LOG_STEP = 1.5
TOLERANCE = 1e-5
MIN_RATIO = 1e-2
"""Smallest estimated noise, as a share of the stated standard deviation."""
MAX_RELATIVE_ERROR = 0.4
MIN_CORRELATION = -0.9
"""Below this correlation of the two estimates, the residuals do not separate them."""


@dataclass(frozen=True, slots=True)
class Repeatability:
    """Scatter of the deviations over visits of the same pose.

    ``per_axis_mm`` are pooled standard deviations along x, y and z, each with the same degrees of freedom:
    visits minus poses.
    """

    per_axis_mm: tuple[float, float, float]
    degrees_of_freedom: int
    poses: int

    @property
    def distance_mm(self) -> float:
        """Root mean square distance of a visit from the mean of its pose."""
        return float(np.linalg.norm(self.per_axis_mm))

    @property
    def at_least_mm(self) -> float:
        """Lower limit of the distance, with 95 % confidence."""
        freedom = 3 * self.degrees_of_freedom
        return self.distance_mm * float(np.sqrt(freedom / chi_square_limit(freedom, 1.0 - CONFIDENCE)))

    def dominates(self, error_mm: float) -> bool:
        """Whether an error (root mean square distance, mm) is significantly smaller than the scatter."""
        return self.at_least_mm > error_mm


def repeatability(
    measurements: MeasurementSet, left_out: Collection[tuple[int, int]] = ()
) -> Repeatability | None:
    """The repeatability in a measurement set; None if no pose was visited twice.

    ``left_out`` are the point and orientation of each record known to be wrong.
    """
    visits: defaultdict[tuple[float, ...], list[int]] = defaultdict(list)  # rows by point and command
    for row, record in enumerate(measurements.records):
        if record.id not in left_out:
            command = (round(value, COMMAND_DIGITS) for value in record.pose.as_tuple())
            visits[record.point, *command].append(row)
    groups = [rows for rows in visits.values() if len(rows) > 1]
    freedom = sum(len(rows) - 1 for rows in groups)
    if not freedom:
        return None
    each = (measurements.deviations[rows] for rows in groups)
    squares = sum(np.sum((one - one.mean(axis=0)) ** 2, axis=0) for one in each)
    return Repeatability(deviation_of(np.sqrt(squares / freedom)), freedom, len(groups))


@dataclass(frozen=True, slots=True)
class NoiseLevel:
    """One kind of noise: standard deviations, as stated in the cell file and as the residuals show them.

    ``at_most`` is an upper limit, two standard errors of the variance above the estimate.
    """

    stated: float
    estimated: float
    standard_error: float
    at_most: float

    @property
    def is_resolved(self) -> bool:
        """Whether the residuals determine the noise, not just an upper limit."""
        return self.standard_error < MAX_RELATIVE_ERROR * self.estimated


@dataclass(frozen=True, slots=True)
class NoiseLevels:
    """The noise of encoders, in ``joint_unit``, and of gauges, mm, and how the two estimates correlate."""

    encoder: NoiseLevel
    gauge: NoiseLevel
    correlation: float
    joint_unit: JointUnit = JointUnit.MM

    @property
    def are_separable(self) -> bool:
        """Whether the residuals separate the two kinds of noise."""
        return self.correlation > MIN_CORRELATION and (self.encoder.is_resolved or self.gauge.is_resolved)


def noise_levels(found: Identification) -> NoiseLevels | None:
    """The noise levels from the residuals; None without redundancy."""
    noise = found.problem.noise
    stated = np.array([noise.encoder, noise.gauge_mm]) ** 2
    if _Equations.at(found, stated).redundancy < 1.0:
        return None
    variances = stated
    for _ in range(MAX_STEPS):
        before = variances
        step = _Equations.at(found, variances).step()
        variances = np.maximum(variances * np.exp(step), MIN_RATIO**2 * stated)
        if np.abs(np.log(variances / before)).max() < TOLERANCE:
            break
    covariance = np.linalg.inv(_Equations.at(found, variances).information)
    errors = np.sqrt(np.diag(covariance))
    encoder, gauge = (
        NoiseLevel(
            stated=float(np.sqrt(known)),
            estimated=float(np.sqrt(variance)),
            standard_error=float(error / (2.0 * np.sqrt(variance))),
            at_most=float(np.sqrt(variance + 2.0 * error)),
        )
        for known, variance, error in zip(stated, variances, errors, strict=True)
    )
    correlation = float(covariance[0, 1] / (errors[0] * errors[1]))
    return NoiseLevels(encoder, gauge, correlation, found.problem.mechanism.words.joint_unit)


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """Both sides of the estimating equation (2,), and the information matrix of the variances (2, 2)."""

    variances: Array
    observed: Array
    expected: Array
    information: Array

    @classmethod
    def at(cls, found: Identification, variances: Array) -> "_Equations":
        """Evaluate at variances (2,), mm^2, with the parameters refitted under them."""
        by_joints = found.prediction.by_joints
        encoder_noise, gauge_noise = np.sqrt(variances).tolist()
        noise = replace(found.problem.noise, encoder=encoder_noise, gauge_mm=gauge_noise)
        reweighted = replace(found.prediction, weights=noise.record_weights(by_joints))
        model = LinearizedModel.around(found.problem, reweighted, found.active_prior)
        unit = replace(found.problem.noise, encoder=1.0, gauge_mm=1.0)
        encoder = unit.encoder_covariance(by_joints)
        cofactors = (encoder, np.broadcast_to(unit.gauge_covariance, encoder.shape))
        scores = model.scores
        observed = [np.einsum("ni,nij,nj->", scores, cofactor, scores) for cofactor in cofactors]
        projected = model.weights - model.weights @ model.explained @ model.weights
        products = [projected @ cofactor for cofactor in cofactors]
        information = np.array([[np.einsum("nij,nji->", a, b) for b in products] for a in products])
        expected = np.array([np.einsum("nii->", product) for product in products])
        scale = 0.5 * (variances @ expected) / (variances @ information @ variances)
        return cls(variances, np.array(observed), expected, scale * information)

    @property
    def redundancy(self) -> float:
        """Degrees of freedom of the residuals."""
        return float(self.variances @ self.expected)

    def step(self) -> Array:
        """The Fisher scoring step of the logarithms of the variances."""
        gradient = 0.5 * self.variances * (self.observed - self.expected)
        information = np.outer(self.variances, self.variances) * self.information
        step: Array = np.linalg.solve(information, gradient)
        return np.clip(step, -MAX_LOG_STEP, MAX_LOG_STEP)
