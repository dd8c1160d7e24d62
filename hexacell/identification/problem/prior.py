"""What is known beforehand: noise, the drawing with its tolerances or an earlier result, other errors.

Systematic errors are no noise: a machine that is as good as is stated of it still has effects that the
kinematic model leaves out. They make the residuals larger than the noise does, which is no evidence
against the model. Some are the same in all records, which makes these errors correlated; others differ
from record to record.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hexacell.identification.placement import RecordPlacement
from hexacell.identification.problem.random_walk import NO_WALK, GaugeWalk
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism, free_parameter_derivatives
from hexacell.kinematics.parameters import CONSTRAINTS, ParameterSet, ParameterUnit
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of the readings of a record and of the gauges' alignment and scale.

    Attributes:
        encoder: of an encoder; where they differ, the root mean square of all.
        gauge_mm: likewise of a gauge.
        alignment: of each component of a station's small rotation against the base, rad; zero if exact.
        gauge_scale: of each gauge's relative scale error; zero if exact.
        encoder_shares: of each encoder, in units of ``encoder``; empty where all are alike.
        gauge_shares: of each gauge, x, y, z, in units of ``gauge_mm``.
        stops: of where a joint stops beside its command, as its encoder shows it: no noise of a record, but
            it moves the ball.
        walk: of the gauges' zero.
        joint_count: how many encoders there are.
        freedom: degrees of freedom with which all this was measured; infinite where it is stated.
        gauge_axes: rows of the matrix whose columns are the gauges' directions in the frame convention;
            empty where all gauges are alike, or along its axes.
    """

    encoder: float
    gauge_mm: float
    alignment: float = 0.0
    gauge_scale: float = 0.0
    encoder_shares: tuple[float, ...] = ()
    gauge_shares: tuple[float, ...] = ()
    gauge_axes: tuple[tuple[float, ...], ...] = ()
    stops: float = 0.0
    walk: GaugeWalk = NO_WALK
    freedom: float = np.inf
    joint_count: int = CONSTRAINTS

    def with_devices(self, encoders: Sequence[float], gauges_mm: Sequence[float]) -> Noise:
        """This noise with that of each encoder, and of the gauges x, y and z."""
        encoder, gauge = (float(np.sqrt(np.mean(np.square(one)))) for one in (encoders, gauges_mm))
        return replace(
            self,
            encoder=encoder,
            gauge_mm=gauge,
            encoder_shares=tuple(mm / encoder for mm in encoders),
            gauge_shares=tuple(mm / gauge for mm in gauges_mm),
        )

    def scaled(self, factor: float) -> Noise:
        """This noise with all readings noisier by a factor."""
        return replace(self, encoder=factor * self.encoder, gauge_mm=factor * self.gauge_mm)

    def along(self, gauges: Array) -> Noise:
        """This noise for gauges whose directions in the frame convention are the columns (3, 3)."""
        if not self.gauge_shares:
            return self
        return replace(self, gauge_axes=tuple(tuple(row) for row in gauges.tolist()))

    @property
    def encoders(self) -> Array:
        """Standard deviation of each encoder (J,), in its unit."""
        return self.encoder * np.array(self.encoder_shares or (1.0,) * self.joint_count)

    @property
    def gauges_mm(self) -> Array:
        """Standard deviation of the gauges x, y and z (3,), mm."""
        return self.gauge_mm * np.array(self.gauge_shares or (1.0,) * 3)

    def encoder_covariance(self, position_by_joints: Array) -> Array:
        """Covariance (n, 3, 3), mm^2, of the ball's position by ``dP/dq`` (n, 3, 6)."""
        scaled = position_by_joints * self.encoders
        return np.asarray(scaled @ np.swapaxes(scaled, -1, -2))

    def chance_covariance(self, position_by_joints: Array) -> Array:
        """Covariance (n, 3, 3), mm^2, of what the gauges show at a commanded pose, by ``dP/dq`` (n, 3, 6).

        By where the joints stop, whether their encoders see it or not, and by the gauges' noise.
        """
        return self.stop_covariance(position_by_joints) + self.record_covariance(position_by_joints)

    def stop_covariance(self, position_by_joints: Array) -> Array:
        """Covariance (n, 3, 3), mm^2, of where the ball comes to rest, by ``dP/dq`` (n, 3, 6)."""
        return np.asarray(self.stops**2 * position_by_joints @ np.swapaxes(position_by_joints, -1, -2))

    @property
    def gauge_covariance(self) -> Array:
        """Covariance (3, 3), mm^2, of what the gauges show, in the frame convention."""
        if not self.gauge_axes:
            return np.diag(self.gauges_mm**2)
        scaled = np.array(self.gauge_axes) * self.gauges_mm
        return np.asarray(scaled @ scaled.T)

    def record_covariance(self, position_by_joints: Array) -> Array:
        """Covariance (n, 3, 3), mm^2, of records by ``dP/dq`` (n, 3, 6), from encoder and gauge noise."""
        return np.asarray(self.encoder_covariance(position_by_joints) + self.gauge_covariance)

    def record_weights(self, position_by_joints: Array) -> Array:
        """Weights (n, 3, 3), 1/mm^2, of records by ``dP/dq`` (n, 3, 6): the inverse of their covariance."""
        return np.linalg.inv(self.record_covariance(position_by_joints))


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Half-widths within which the built robot differs from its drawing.

    Attributes:
        by_kind: for all parameters of a kind, in its unit, by the kind's symbol.
        ball_mm: for the ball's mounting, an offset common to all platform joints.
    """

    by_kind: Mapping[str, float]
    ball_mm: float = 0.0

    @classmethod
    def of_settings(cls, parameters: ParameterSet, settings: Mapping[str, float]) -> Tolerances:
        """The tolerances of a cell file: under the keys of the kinds, and ``ball_mm``."""
        by_kind = {kind.symbol: settings[kind.tolerance_key] for kind in parameters.kinds}
        return cls(by_kind, settings["ball_mm"])

    def widths(self, parameters: ParameterSet) -> Array:
        """The half-width of each parameter (P,), without the ball's offset."""
        return parameters.by_kind(self.by_kind)

    def scaled(self, share: float) -> Tolerances:
        """A share of all of them."""
        by_kind = {symbol: share * width for symbol, width in self.by_kind.items()}
        return Tolerances(by_kind, share * self.ball_mm)

    def sum_mm(self, parameters: ParameterSet) -> float:
        """Sum of all length tolerances, the ball's offset included."""
        lengths = (self.by_kind[kind.symbol] for kind in parameters.kinds if kind.unit is ParameterUnit.MM)
        return sum(lengths) + self.ball_mm


@dataclass(frozen=True, eq=False)
class Prior:
    """The Gaussian prior of the geometry: the drawing and its tolerances.

    Attributes:
        centre: the drawing, in the mechanism's frame convention.
        free: its free parameters (p,), mm; ``covariance`` (p, p) of these, mm^2.
        tolerance_sigma: (p,) their standard deviations by their own tolerances, mm, without those of the
            parameters that define the frames; None where the prior is no drawing.
        is_estimate: whether it is an earlier estimate, with what may have drifted since.
    """

    centre: Geometry
    free: Array
    covariance: Array
    tolerance_sigma: Array | None = None
    is_estimate: bool = False

    @classmethod
    def of(cls, mechanism: Mechanism, drawing: Geometry, tolerances: Tolerances) -> Prior:
        """The Gaussian with the second moments of errors uniform within the tolerances, to first order.

        The tolerances hold for all parameters in the frames of the ``drawing``; the change to the
        convention's frames correlates them.
        """
        centre, _ = mechanism.normalize_frames(drawing)
        by_parameters = free_parameter_derivatives(mechanism, drawing)
        ball, widths = mechanism.parameters.ball_offset, tolerances.widths(mechanism.parameters)
        factor = np.vstack([widths[:, None] * by_parameters, tolerances.ball_mm * (ball @ by_parameters)])
        own = np.vstack([np.diag(widths), tolerances.ball_mm * ball])
        own_sigma = np.linalg.norm(own, axis=0)[mechanism.convention.free_rows] / np.sqrt(3.0)
        return cls(centre, mechanism.convention.free_parameters(centre), factor.T @ factor / 3.0, own_sigma)

    @property
    def sigma(self) -> Array:
        """What counts as unknown of each free parameter (p,): the tolerances, if there are any; mm."""
        if self.tolerance_sigma is not None:
            return self.tolerance_sigma
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @cached_property
    def precision(self) -> Array:
        """Precision (p, p) of the free parameters, 1/mm^2."""
        return np.linalg.inv(self.covariance)

    def squared_distance(self, free: Array) -> float:
        """Squared distance of free parameters (p,), mm, from the drawing, in standard deviations."""
        change = free - self.free
        return float(change @ np.linalg.solve(self.covariance, change))

    def leg_widths(self, mechanism: Mechanism) -> Array:
        """The largest tolerances (c,) of the numbers of one leg, the ball's offset included."""
        parameters, widths = mechanism.parameters, np.zeros(len(mechanism.parameters))
        widths[mechanism.convention.free_rows] = np.sqrt(3.0 * np.diag(self.covariance))
        largest = [parameters.array(widths, kind.symbol).max() for kind in parameters.kinds]
        return np.repeat(largest, [kind.numbers_per_row for kind in parameters.kinds])


@dataclass(frozen=True, eq=False)
class IdentifiedBefore:
    """A geometry that was identified some time ago, and that may have changed since.

    It is known with the sum of two covariances. How much it changed is known only roughly: the drift's
    scale, a factor of its standard deviation, is estimated from new records by their marginal likelihood
    (empirical Bayes; Berger, Statistical Decision Theory and Bayesian Analysis, 1985, section 3.5).

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
    """Covariance (p, p) of the free parameters when all parameters change, with ``sigma`` (P,) each.

    Those that the frame convention of the ``geometry`` fixes change as well, and it then moves the others.
    """
    factor = sigma[:, None] * free_parameter_derivatives(mechanism, geometry)
    return np.asarray(factor.T @ factor)


def drift_sigma(mechanism: Mechanism, sigma_mm: float, tolerances: Tolerances) -> Array:
    """Standard deviations (P,) of the drift, that of lengths being given.

    Of other parameters it is the same share of the tolerance as of the largest tolerance of a length.
    """
    parameters, widths = mechanism.parameters, tolerances.widths(mechanism.parameters)
    is_length = np.array([p.kind.unit is ParameterUnit.MM for p in parameters.parameters])
    return np.where(is_length, sigma_mm, (sigma_mm / widths[is_length].max()) * widths)


@dataclass(frozen=True, slots=True, eq=False)
class SystematicErrors:
    """Errors of n records, mm, beside their noise.

    Attributes:
        common: (n, 3, k) by one standard deviation of each of k independent causes.
        own: (n, 3, 3) covariance, mm^2, of what is another error in each record.
    """

    common: Array
    own: Array


SystematicModel = Callable[[RecordPlacement], SystematicErrors]
"""The errors of records that are no noise."""


def no_systematic_errors(records: RecordPlacement) -> SystematicErrors:
    """The systematic errors of a machine that has none: zero."""
    return SystematicErrors(np.zeros((len(records), 3, 0)), np.zeros((len(records), 3, 3)))
