"""The identification problem: records, prior and noise in the form that the solver takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.problem.commanded_poses import CommandedPoses
from hexacell.identification.problem.systematic_errors import SystematicModel, no_systematic_errors
from hexacell.kinematics.forward import ForwardResult
from hexacell.kinematics.frame_derivatives import free_parameter_derivatives
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import LEGS, ParameterSet, ParameterUnit
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask


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

    def with_devices(self, encoders: Sequence[float], gauges_mm: Sequence[float]) -> Noise:
        """The same with the noise of each encoder, and of the gauges x, y and z."""
        encoder, gauge = (float(np.sqrt(np.mean(np.square(one)))) for one in (encoders, gauges_mm))
        return replace(
            self,
            encoder=encoder,
            gauge_mm=gauge,
            encoder_shares=tuple(mm / encoder for mm in encoders),
            gauge_shares=tuple(mm / gauge for mm in gauges_mm),
        )

    def scaled(self, factor: float) -> Noise:
        """The same with all readings noisier by a factor."""
        return replace(self, encoder=factor * self.encoder, gauge_mm=factor * self.gauge_mm)

    def along(self, gauges: Array) -> Noise:
        """The same of gauges whose directions in the frame convention are the columns (3, 3)."""
        if not self.gauge_shares:
            return self
        return replace(self, gauge_axes=tuple(tuple(row) for row in gauges.tolist()))

    @property
    def encoders(self) -> Array:
        """Of each encoder (6,)."""
        return self.encoder * np.array(self.encoder_shares or (1.0,) * LEGS)

    @property
    def gauges_mm(self) -> Array:
        """Of each gauge (3,), along x, y and z."""
        return self.gauge_mm * np.array(self.gauge_shares or (1.0,) * 3)

    def encoder_covariance(self, position_by_joints: Array) -> Array:
        """Covariance (n, 3, 3), mm^2, of the ball's position by ``dP/dq`` (n, 3, 6)."""
        scaled = position_by_joints * self.encoders
        covariance: Array = scaled @ np.swapaxes(scaled, -1, -2)
        return covariance

    @property
    def gauge_covariance(self) -> Array:
        """Covariance (3, 3), mm^2, of what the gauges show, in the frame convention."""
        if not self.gauge_axes:
            return np.diag(self.gauges_mm**2)
        scaled = np.array(self.gauge_axes) * self.gauges_mm
        covariance: Array = scaled @ scaled.T
        return covariance


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
        free: its free parameters (p,), mm.
        covariance: (p, p) of the free parameters, mm^2.
        tolerance_sigma: (p,) their standard deviations by their own tolerances, mm, without those of the
            parameters that define the frames; none where the prior is no drawing.
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
        by_ball = mechanism.parameters.ball_offset @ by_parameters
        widths = tolerances.widths(mechanism.parameters)[:, None]
        factor = np.vstack([widths * by_parameters, tolerances.ball_mm * by_ball])
        own = np.vstack([np.diag(widths[:, 0]), tolerances.ball_mm * mechanism.parameters.ball_offset])
        own_sigma = np.linalg.norm(own, axis=0)[mechanism.convention.free_rows()] / np.sqrt(3.0)
        free = mechanism.convention.free_parameters(centre)
        return cls(centre, free, factor.T @ factor / 3.0, own_sigma)

    @property
    def sigma(self) -> Array:
        """What counts as unknown of each free parameter (p,): the tolerances, if there are any; mm."""
        if self.tolerance_sigma is not None:
            return self.tolerance_sigma
        sigma: Array = np.sqrt(np.diag(self.covariance))
        return sigma

    @cached_property
    def precision(self) -> Array:
        """(p, p), 1/mm^2."""
        return np.linalg.inv(self.covariance)

    def squared_distance(self, free: Array) -> float:
        """Squared distance of free parameters (p,), mm, from the drawing, in standard deviations."""
        change = free - self.free
        return float(change @ np.linalg.solve(self.covariance, change))

    def leg_widths(self, mechanism: Mechanism) -> Array:
        """The largest tolerances (c,) of the numbers of one leg, the ball's offset included."""
        widths = np.zeros(len(mechanism.parameters))
        widths[mechanism.convention.free_rows()] = np.sqrt(3.0 * np.diag(self.covariance))
        parameters = mechanism.parameters
        largest = [parameters.array(widths, kind.symbol).max() for kind in parameters.kinds]
        return np.repeat(largest, [kind.numbers_per_leg for kind in parameters.kinds])


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Records in the frame convention, sorted by point.

    Attributes:
        joints: (n, 6), mm, measured by the encoders.
        deviations: (n, 3), mm, in the convention's base frame.
        first_rows: (m,) row at which each point begins.
        commands: the commanded poses.
        initial_parameters: free parameters (p,), mm, at which the solver starts: those of the last
            provisional geometry, or of the geometry that commanded most records, usually the drawing.
        start: poses that close ``initial_parameters`` at ``joints``.
        has_start_pose: (n,) bool, whether ``start`` has a pose of the record; a singularity may lie
            between the geometry that commanded the record and the initial one.
        labels: (n, 2) point and orientation, counted from 1.
        gauges: (3, 3), columns: measuring directions of the gauges x, y and z in the convention's
            base frame.
        systematic: the errors of records that are no noise. The estimate takes no account of them, the
            tests of it do.
        unknowns: how many parameters the records are to determine, the rest of them being known from the
            prior; 0: all.
    """

    mechanism: Mechanism
    prior: Prior
    noise: Noise
    joints: Array
    deviations: Array
    first_rows: NDArray[np.intp]
    commands: CommandedPoses
    initial_parameters: Array
    start: PoseBatch
    has_start_pose: Mask
    labels: NDArray[np.int_]
    gauges: Array
    systematic: SystematicModel = field(default=no_systematic_errors)
    unknowns: int = 0

    @property
    def basis(self) -> Array:
        """(P, p), from the free parameters to all parameters."""
        return self.mechanism.convention.basis()

    @property
    def like_a_mm(self) -> Array:
        """What counts as much as a millimetre of each free parameter (p,)."""
        return self.mechanism.parameters.like_a_mm[self.mechanism.convention.free_rows()]

    @property
    def points(self) -> int:
        """The number of points with records."""
        return len(self.first_rows)

    @property
    def records(self) -> int:
        """The number of records."""
        return len(self.joints)

    @property
    def coordinates(self) -> int:
        """The number of measured coordinates, less the unknown constants of the points."""
        return 3 * (self.records - self.points)

    def geometry(self, free: Array) -> Geometry:
        """The geometry of free parameters (p,), mm."""
        return self.mechanism.convention.geometry(free)

    def solve_poses(self, free: Array) -> ForwardResult:
        """Poses that close the geometry of free parameters (p,), mm, at the records' joint variables."""
        return self.commands.solve_poses(self.geometry(free), self.joints)

    def rows_of(self, labels: NDArray[np.int_]) -> NDArray[np.intp]:
        """The rows (k,) of records by their labels (k, 2); -1 for one that is not here."""
        rows = {tuple(label): row for row, label in enumerate(self.labels.tolist())}
        return np.array([rows.get(tuple(label), -1) for label in labels.tolist()], dtype=np.intp)

    def group_sums(self, values: Array) -> Array:
        """Sums over the records of each point: (n, ...) to (m, ...)."""
        return np.add.reduceat(values, self.first_rows, axis=0)

    @property
    def stations(self) -> NDArray[np.intp]:
        """The row (n,) of each record's point among the points."""
        lengths = np.diff(np.append(self.first_rows, self.records))
        return np.arange(self.points).repeat(lengths)

    def per_record(self, values: Array) -> Array:
        """A value of each point (m, ...), repeated for each of its records (n, ...)."""
        return values[self.stations]

    def starting_at(self, free: Array, poses: PoseBatch, has_start_pose: Mask | None = None) -> Problem:
        """The problem with another start: free parameters (p,), mm, and poses that close them."""
        known = self.has_start_pose if has_start_pose is None else has_start_pose
        return replace(self, initial_parameters=free, start=poses, has_start_pose=known)

    def subset(self, rows: Mask) -> Problem:
        """The problem of some of the records (n,)."""
        if rows.all():
            return self
        kept = np.flatnonzero(rows)
        return replace(
            self,
            joints=self.joints[kept],
            deviations=self.deviations[kept],
            first_rows=first_rows_of(self.labels[kept, 0]),
            commands=self.commands[kept],
            start=self.start[kept],
            has_start_pose=self.has_start_pose[kept],
            labels=self.labels[kept],
        )

    def joined(self, other: Problem) -> Problem:
        """The problem of both sets of records, which have no point in common, from the same start."""
        labels = np.concatenate([self.labels, other.labels])
        order = np.argsort(labels[:, 0], kind="stable")
        commands = self.commands.joined(other.commands)
        return replace(
            self,
            joints=np.concatenate([self.joints, other.joints])[order],
            deviations=np.concatenate([self.deviations, other.deviations])[order],
            first_rows=first_rows_of(labels[order, 0]),
            commands=commands[order],
            start=PoseBatch.concatenate([self.start, other.start])[order],
            has_start_pose=np.concatenate([self.has_start_pose, other.has_start_pose])[order],
            labels=labels[order],
        )


def first_rows_of(points: NDArray[np.int_]) -> NDArray[np.intp]:
    """The rows (m,) at which each point of sorted records (n,) begins."""
    return np.flatnonzero(np.diff(points, prepend=points[:1] - 1))
