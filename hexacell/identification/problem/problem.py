"""The identification problem: records, prior and noise in the form that the solver takes.

:meth:`Assumptions.problem` makes it of records, from the problem of some of them if that is known.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import IdentifiabilityError
from hexacell.identification.placement import Placement, RecordPlacement
from hexacell.identification.problem.commanded_poses import (
    CommandedPoses,
    CommandingGeometry,
    require_consistent_encoders,
)
from hexacell.identification.problem.prior import Noise, Prior, SystematicModel, no_systematic_errors
from hexacell.identification.terms.taken import TakenTerms, mean_of
from hexacell.identification.terms.term import ModelTerm
from hexacell.identification.thermal_expansion import ThermalExpansion
from hexacell.kinematics.forward import ForwardResult
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.measurements.records import Deviation, MeasurementSet, RecordId, Temperatures

LEAST_SPARE_EQUATIONS = 13
"""Equations beyond the parameters from which agreement is a proof: fewer agree by chance."""

NO_TRAVEL_MM: Deviation = (np.inf, np.inf, np.inf)
"""Where the measuring ranges of the gauges are not known."""

MAX_COUNTED_POSES = 1000
"""Number of records above which all poses count as different."""

OF_EACH_RECORD = ("joints", "deviations", "times_s", "directions", "warmer", "has_start_pose", "labels")
"""Arrays of a problem that have a row for each record."""

Values = TypeVar("Values", Array, Mask)


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Records in the frame convention, sorted by point.

    Attributes:
        joints: (n, 6), mm, measured by the encoders, as they would be with parts as warm as the geometry's.
        warmer: (n, 7), K, by how much legs and base were warmer than that.
        holds_at: the temperatures of the geometry.
        deviations: (n, 3), mm, in the convention's base frame.
        times_s: (n,) when each was read; NaN where that is not known.
        directions: (n, 6) from which side each joint arrived, 1 or -1; 0 where that is not known.
        first_rows: (m,) row at which each point begins.
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
        travel_mm: measuring range of the gauges x, y and z.
        offered: terms of the model beside the geometry that the machine may have.
        terms: those that its records are taken to have; None for none.
    """

    mechanism: Mechanism
    prior: Prior
    noise: Noise
    joints: Array
    deviations: Array
    times_s: Array
    directions: Array
    warmer: Array
    holds_at: Temperatures
    first_rows: NDArray[np.intp]
    commands: CommandedPoses
    initial_parameters: Array
    start: PoseBatch
    has_start_pose: Mask
    labels: NDArray[np.int_]
    gauges: Array
    systematic: SystematicModel = field(default=no_systematic_errors)
    unknowns: int = 0
    travel_mm: Deviation = NO_TRAVEL_MM
    offered: tuple[ModelTerm, ...] = ()
    terms: TakenTerms | None = None

    @property
    def basis(self) -> Array:
        """(P, p), from the free parameters to all parameters."""
        return self.mechanism.convention.basis

    @property
    def like_a_mm(self) -> Array:
        """What counts as much as a millimetre of each free parameter (p,)."""
        return self.mechanism.parameters.like_a_mm[self.mechanism.convention.free_rows]

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

    @property
    def different_poses(self) -> int:
        """The number of different poses."""
        if self.records > MAX_COUNTED_POSES:
            return self.records
        poses = self.commands.poses
        matrices = poses.rotations.reshape(-1, 9)
        numbers = np.column_stack([self.labels[:, 0], poses.positions, matrices]).round(9)
        return len(set(map(tuple, numbers.tolist())))

    @property
    def equations(self) -> int:
        """Three equations for each different pose, less three for each point's reference."""
        return 3 * (self.different_poses - self.points)

    @property
    def is_determined(self) -> bool:
        """Whether at least two points give at least as many equations as parameters."""
        return self.points >= 2 and self.equations >= len(self.prior.covariance)

    @property
    def is_overdetermined(self) -> bool:
        """Whether at least two points give so many equations to spare that agreement proves something."""
        spare = self.equations - len(self.prior.covariance)
        return self.points >= 2 and spare >= LEAST_SPARE_EQUATIONS

    def geometry(self, free: Array) -> Geometry:
        """The geometry of free parameters (p,), mm."""
        return self.mechanism.convention.geometry(free)

    def measured_at(self, free: Array, poses: PoseBatch) -> RecordPlacement:
        """The robot at the records under free parameters (p,), mm, that give them these poses."""
        geometry = self.geometry(free)
        readings = self.joints, self.deviations, self.gauges, self.directions, self.warmer
        return RecordPlacement(self.mechanism, geometry, poses, *readings)

    def residuals(self, positions: Array) -> Array:
        """Where the ball is with its terms, by positions (n, 3) without, less deviations; mm."""
        without: Array = positions - self.deviations
        return without if self.terms is None else without + self.terms.offset

    def solve_poses(self, free: Array) -> ForwardResult:
        """Poses that close the geometry of free parameters (p,), mm, at the records' joint variables."""
        return self.commands.solve_poses(self.geometry(free), self.joints)

    @property
    def record_ids(self) -> list[RecordId]:
        """Point and orientation of each record."""
        return [(point, orientation) for point, orientation in self.labels.tolist()]

    def mask_of(self, records: Collection[RecordId]) -> Mask:
        """Which records (n,) are among some others."""
        return np.array([record in records for record in self.record_ids], dtype=bool)

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
        return np.arange(self.points).repeat(np.diff(np.append(self.first_rows, self.records)))

    def per_record(self, values: Array) -> Array:
        """A value of each point (m, ...), repeated for each of its records (n, ...)."""
        return values[self.stations]

    def starting_at(self, free: Array, poses: PoseBatch, has_start_pose: Mask | None = None) -> Problem:
        """The problem that starts at free parameters (p,), mm, and poses of all or of some records (n,)."""
        known = np.ones(self.records, dtype=bool) if has_start_pose is None else has_start_pose
        return replace(self, initial_parameters=free, start=poses, has_start_pose=known)

    def started_at(self, free: Array) -> Problem:
        """The problem that starts at free parameters (p,), mm, as far as its records have poses there."""
        solved = self.solve_poses(free)
        return self.starting_at(free, solved.poses, solved.found)

    def with_terms(self, terms: tuple[ModelTerm, ...], values: Array | None = None) -> Problem:
        """The problem of a machine with some terms, as they act at the start poses.

        They are linearized at coefficients of some ``values`` (6 m,), which are known from a fit with them.
        """
        if not terms:
            return replace(self, terms=None)
        records = self.measured_at(self.initial_parameters, self.start)
        return replace(self, terms=TakenTerms.of(terms, records, self.has_start_pose, values))

    def subset(self, rows: Mask) -> Problem:
        """The problem of some of the records (n,)."""
        if rows.all():
            return self
        kept = np.flatnonzero(rows)
        return replace(
            self,
            **{name: getattr(self, name)[kept] for name in OF_EACH_RECORD},
            first_rows=first_rows_of(self.labels[kept, 0]),
            commands=self.commands[kept],
            start=self.start[kept],
            terms=self.terms and self.terms[kept],
        )

    def joined(self, other: Problem) -> Problem:
        """The problem of both sets of records, which have no point in common, from the same start.

        Both have the same terms.
        """
        pairs = {name: (getattr(self, name), getattr(other, name)) for name in OF_EACH_RECORD}
        both: dict[str, Any] = {name: np.concatenate(pair) for name, pair in pairs.items()}
        points = both["labels"][:, 0]
        order, terms = np.argsort(points, kind="stable"), self.terms
        if terms is not None and other.terms is not None:
            terms = terms.joined(other.terms)[order]
        return replace(
            self,
            **{name: values[order] for name, values in both.items()},
            first_rows=first_rows_of(points[order]),
            commands=self.commands.joined(other.commands)[order],
            start=PoseBatch.joined([self.start, other.start])[order],
            terms=terms,
        )


def first_rows_of(points: NDArray[np.int_]) -> NDArray[np.intp]:
    """The rows (m,) at which each point of sorted records (n,) begins."""
    return np.flatnonzero(np.diff(points, prepend=points[:1] - 1))


@dataclass(frozen=True, slots=True, eq=False)
class Assumptions:
    """What the identification of records takes as known of the robot.

    Attributes:
        controller: under which the records were commanded.
        provisional: geometries, in the frame convention, that commanded in the controller's frames for a
            while; the last one was used last.
        earlier: geometries that may have commanded records from before the last calibration, in frames of
            their own.
        expansion: by temperature, and how warm the sought geometry is.
    """

    mechanism: Mechanism
    controller: CommandingGeometry
    branch: Branch
    prior: Prior
    noise: Noise
    provisional: Sequence[Geometry] = ()
    earlier: Sequence[CommandingGeometry] = ()
    systematic: SystematicModel = no_systematic_errors
    unknowns: int = 0
    travel_mm: Deviation = NO_TRAVEL_MM
    offered: tuple[ModelTerm, ...] = ()
    known_terms: tuple[ModelTerm, ...] = ()
    expansion: ThermalExpansion = field(default_factory=ThermalExpansion)

    def problem(self, measurements: MeasurementSet, known: Problem | None = None) -> Problem:
        """The problem of a measurement set, in any order, from the ``known`` one of some of its records.

        A record does not change how those before it were commanded, nor their start poses; these are taken
        over and computed for the new records alone, unless it changes what is known of the temperatures
        before it.

        Raises:
            IdentifiabilityError: joint variables do not belong to the commanded poses, or for most records
                no continuation from the commanding to the initial geometry exists; the message names the
                first.
        """
        mechanism, frames = self.mechanism, self.controller.frames
        order = np.argsort(measurements.group, kind="stable")
        labels = measurements.labels[order]
        own = (CommandingGeometry(one, frames) for one in (*self.provisional, self.prior.centre))
        candidates = [self.controller, *own, *self.earlier]
        if known is not None and not known.commands.are_of(candidates):
            known = None
        rows = np.full(len(labels), -1) if known is None else known.rows_of(labels)
        warmer = self.expansion.warmer(measurements)[order]
        if known is not None and not np.array_equal(known.warmer[rows[rows >= 0]], warmer[rows >= 0]):
            known, rows = None, np.full(len(labels), -1)
        new = measurements.subset(order[rows < 0])
        deviations, legs = frames.deviations(new.deviations), mechanism.joint_count
        new_joints = new.joints.reshape(len(new), legs)  # no records do not tell of how many joints
        commands = CommandedPoses.of(mechanism, new.poses, candidates, self.branch, new_joints)
        placed = Placement(mechanism, self.prior.centre, commands.poses, new_joints)
        joints = self.expansion.joints_without(placed, warmer[rows < 0])
        if known is not None:
            joints = _interleaved(known.joints, rows, joints)
            deviations = _interleaved(known.deviations, rows, deviations)
            commands = known.commands.with_others(rows, commands)
        require_consistent_encoders(commands, joints, labels, self.prior)
        initial = self.provisional[-1] if self.provisional else commands.most_frequent_geometry
        free = mechanism.convention.free_parameters(initial)
        if known is not None and np.array_equal(known.initial_parameters, free):
            added = np.flatnonzero(rows < 0)
            solved = commands[added].solve_poses(initial, joints[added])
            found = _interleaved(known.has_start_pose, rows, solved.found)
            start = ForwardResult(known.start[rows].with_rows(added, solved.poses), found)
        else:
            start = commands.solve_poses(initial, joints)
        _require_start_poses(start.found, labels)
        made = Problem(
            mechanism=mechanism,
            prior=self.prior,
            noise=self.noise.along(frames.base),
            joints=joints,
            deviations=deviations,
            times_s=measurements.times_s[order],
            directions=measurements.directions[order].reshape(len(labels), legs),
            warmer=warmer,
            holds_at=self.expansion.holds_at(measurements),
            first_rows=first_rows_of(labels[:, 0]),
            commands=commands,
            initial_parameters=free,
            start=start.poses,
            has_start_pose=start.found,
            labels=labels,
            gauges=frames.base,
            systematic=self.systematic,
            unknowns=self.unknowns,
            travel_mm=self.travel_mm,
            offered=self.offered,
        )
        if not self.known_terms:
            return made
        return made.with_terms(self.known_terms, mean_of(self.known_terms))


def _interleaved(known: Values, rows: NDArray[np.intp], new: Values) -> Values:
    """Values (n, ...): known ones in the order of their ``rows`` (n,), and new ones where that is -1."""
    values = known[rows]
    values[rows < 0] = new
    return values


def _require_start_poses(found: Mask, labels: NDArray[np.int_]) -> None:
    """Require a start pose for at least half of the records; the solver leaves the others out."""
    missing = np.flatnonzero(~found)
    if 2 * len(missing) <= len(found):
        return
    point, orientation = labels[missing[0]]
    raise IdentifiabilityError(
        f"in {len(missing)} of {len(found)} records a singularity lies between the commanded pose and the "
        f"joint variables; the first is point {point}, orientation {orientation}",
        action="Check that q1, q2, ... belong to these poses, and the poses to this controller's config",
    )
