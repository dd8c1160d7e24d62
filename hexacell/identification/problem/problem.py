"""What is to be identified from what: the records, the prior and the noise, ready for a solver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem.commanded_poses import CommandedPoses
from hexacell.identification.problem.encoder_consistency import EncoderConsistency
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.parameters import ParameterSet, ParameterUnit
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.measurements.records import MeasurementSet


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of one record's numbers, mm, and of how the gauges stand.

    ``alignment`` is the prior of each station's small rotation against the base, rad a component;
    ``gauge_scale`` that of each gauge's relative scale error. Zero says there is none.
    """

    encoder_mm: float
    gauge_mm: float
    alignment: float = 0.0
    gauge_scale: float = 0.0


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Half-widths within which the built robot differs from its drawing.

    Attributes:
        by_kind: of every parameter of a kind, in its unit, by the kind's symbol.
        ball_mm: of an offset common to all platform joints: where the ball was really mounted.
    """

    by_kind: Mapping[str, float]
    ball_mm: float = 0.0

    @classmethod
    def of_settings(cls, parameters: ParameterSet, settings: Mapping[str, float]) -> Tolerances:
        """The tolerances under the kinds' keys and ``ball_mm``, as the cell file has them."""
        by_kind = {kind.symbol: settings[kind.tolerance_key] for kind in parameters.kinds}
        return cls(by_kind, settings["ball_mm"])

    def widths(self, parameters: ParameterSet) -> Array:
        """The half-width of each parameter (P,), the ball's offset left out."""
        return parameters.by_kind(self.by_kind)

    def sum_mm(self, parameters: ParameterSet) -> float:
        """All tolerances of lengths together, the ball's offset included."""
        lengths = (self.by_kind[kind.symbol] for kind in parameters.kinds if kind.unit is ParameterUnit.MM)
        return sum(lengths) + self.ball_mm


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """What is known before measuring: the drawing and how well it was kept.

    Attributes:
        centre: the drawing, in the mechanism's frame convention.
        covariance: (p, p) of the free parameters, mm^2.
    """

    centre: Geometry
    covariance: Array

    @classmethod
    def of(cls, mechanism: Mechanism, drawing: Geometry, tolerances: Tolerances) -> Prior:
        """A Gaussian with the second moments of errors that are uniform within the tolerances."""
        centre, _ = mechanism.normalize_frames(drawing)
        rows = mechanism.convention.free_rows()
        covariance = np.diag(tolerances.widths(mechanism.parameters)[rows] ** 2 / 3.0)
        for common in mechanism.parameters.ball_offset[:, rows]:
            covariance += tolerances.ball_mm**2 / 3.0 * np.outer(common, common)
        return cls(centre, covariance)

    def leg_widths(self, mechanism: Mechanism) -> Array:
        """The largest tolerances (c,) of a leg's own numbers, by kind, the ball's offset included."""
        widths = np.zeros(len(mechanism.parameters))
        widths[mechanism.convention.free_rows()] = np.sqrt(3.0 * np.diag(self.covariance))
        parameters = mechanism.parameters
        largest = [parameters.array(widths, kind.symbol).max() for kind in parameters.kinds]
        return np.repeat(largest, [kind.numbers_per_leg for kind in parameters.kinds])


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Records in the frame convention, sorted by point.

    Attributes:
        joints: (n, 6), mm, as the encoders gave them.
        deviations: (n, 3), mm, in the convention's base frame.
        first_rows: (m,) row at which each point begins.
        commands: what the records were commanded with.
        initial_parameters: free parameters (p,), mm, where a search begins: those of the geometry that
            commanded most records, as a rule the drawing, or those of the last provisional geometry.
        start: poses that close them at ``joints``.
        has_start_pose: (n,) bool, where there is such a pose: a singularity may lie between the
            geometry that commanded a record and this one.
        labels: (n, 2) point and orientation as the user counts them.
        gauges: (3, 3), columns: along which the gauges x, y and z measure, in the convention's
            base frame.
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

    @property
    def basis(self) -> Array:
        """(P, p), from free parameters to all of them."""
        return self.mechanism.convention.basis()

    @property
    def points(self) -> int:
        """How many points have records."""
        return len(self.first_rows)

    @property
    def records(self) -> int:
        """How many records there are."""
        return len(self.joints)

    def group_sums(self, values: Array) -> Array:
        """Sums over the records of each point: (n, ...) to (m, ...)."""
        return np.add.reduceat(values, self.first_rows, axis=0)

    def per_record(self, values: Array) -> Array:
        """A value a point (m, ...) repeated for each of its records (n, ...)."""
        lengths = np.diff(np.append(self.first_rows, self.records))
        return np.repeat(values, lengths, axis=0)

    def subset(self, rows: Mask) -> Problem:
        """The same problem with some of its records (n,) only."""
        kept = np.flatnonzero(rows)
        return Problem(
            self.mechanism,
            self.prior,
            self.noise,
            self.joints[kept],
            self.deviations[kept],
            _first_rows(self.labels[kept, 0]),
            self.commands[kept],
            self.initial_parameters,
            self.start[kept],
            self.has_start_pose[kept],
            self.labels[kept],
            self.gauges,
        )


def build_problem(
    mechanism: Mechanism,
    measurements: MeasurementSet,
    *,
    controller: Geometry,
    branch: Branch,
    prior: Prior,
    noise: Noise,
    provisional: Sequence[Geometry] = (),
) -> Problem:
    """The problem of some records, whose poses were commanded under ``controller``'s geometry.

    Records from before the last calibration may have been commanded under the drawing instead, and
    others under ``provisional`` geometries, in the frame convention.

    Raises:
        IdentifiabilityError: joint variables do not belong to the commanded poses, or most records
            cannot be followed from the geometry that commanded them to the one where the search
            begins; the message names the first.
    """
    order = np.argsort(measurements.group, kind="stable")
    joints, labels = measurements.joints[order], measurements.labels[order]
    commanding, change = mechanism.normalize_frames(controller)
    poses = change.poses(measurements.poses[order])
    commands = CommandedPoses.of(mechanism, poses, (commanding, *provisional, prior.centre), branch, joints)
    EncoderConsistency(commands, joints, labels, branch, prior.centre, prior.leg_widths(mechanism)).check()
    begin = provisional[-1] if provisional else commands.most_frequent_geometry
    start = commands.solve_poses(begin, joints)
    _refuse_strangers(start.found, labels)
    return Problem(
        mechanism=mechanism,
        prior=prior,
        noise=noise,
        joints=joints,
        deviations=change.deviations(measurements.deviations[order]),
        first_rows=_first_rows(labels[:, 0]),
        commands=commands,
        initial_parameters=mechanism.convention.free_parameters(begin),
        start=start.poses,
        has_start_pose=start.found,
        labels=labels,
        gauges=change.base,
    )


def _refuse_strangers(found: Mask, labels: NDArray[np.int_]) -> None:
    """A few records beyond a singularity are no obstacle; where most are, something else is wrong."""
    lost = np.flatnonzero(~found)
    if 2 * len(lost) <= len(found):
        return
    point, orientation = labels[lost[0]]
    raise IdentifiabilityError(
        f"{len(lost)} of {len(found)} records cannot be followed from the commanded pose to the joint "
        f"variables without crossing a singularity; the first is point {point}, orientation {orientation}",
        action="Check that q1 to q6 belong to these poses, and the poses to this controller's config",
    )


def _first_rows(points: NDArray[np.int_]) -> NDArray[np.intp]:
    return np.flatnonzero(np.diff(points, prepend=points[:1] - 1))
