"""The commanded poses of records: the start of their forward kinematics, and a check of their encoders.

A pose is commanded under a geometry and in its frames: those of the controller, or earlier ones if the
record is older than the last calibration. Each record is attributed to the geometry whose inverse
kinematics is nearest to its encoders. Its pose under any other geometry is found by continuation from
there.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem.prior import Prior
from hexacell.kinematics.forward import CONTINUATION_STAGES, ForwardResult, continue_solution
from hexacell.kinematics.geometry import Geometries, Geometry, GeometryBatch
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array, Mask

SAME_GEOMETRY_STAGES = (1, *CONTINUATION_STAGES)
"""Continuation stages under the commanding geometry: the joint variables are near the commanded ones."""

ACCEPTED_MM = 1.0
"""Differences of joint variables from the commanded ones up to this are normal on any machine."""

MAX_OUTLIER_SHARE = 0.2
"""Largest share of the records whose joint variables may be inconsistent."""


@dataclass(frozen=True, slots=True, eq=False)
class CommandingGeometry:
    """A geometry that commanded records, and the frames in which it was given their poses.

    Attributes:
        geometry: in the mechanism's frame convention.
        frames: from the frames of its commands to the convention's.
    """

    geometry: Geometry
    frames: FrameTransform

    @classmethod
    def of(cls, mechanism: Mechanism, stated: Geometry) -> CommandingGeometry:
        """A geometry as a controller's config states it, in frames of its own."""
        return cls(*mechanism.normalize_frames(stated))


@dataclass(frozen=True, slots=True, eq=False)
class CommandedPoses:
    """The commands of n records, each attributed to the geometry whose inverse kinematics is nearest.

    Attributes:
        poses: the commanded poses, in the convention's frames.
        candidate_geometries: geometries that may have commanded them.
        choice: (n,) the index of the one that did.
        joints: (n, 6), mm, its inverse kinematics; NaN where no candidate reaches the pose.
    """

    mechanism: Mechanism
    branch: Branch
    poses: PoseBatch
    candidate_geometries: Sequence[Geometry]
    choice: NDArray[np.intp]
    joints: Array

    @classmethod
    def of(
        cls,
        mechanism: Mechanism,
        commands: PoseBatch,
        candidates: Sequence[CommandingGeometry],
        branch: Branch,
        measured: Array,
    ) -> CommandedPoses:
        """Attribute poses, as sent, to candidate geometries by the measured joint variables (n, 6), mm."""
        poses = [candidate.frames.poses(commands) for candidate in candidates]
        geometries = [candidate.geometry for candidate in candidates]
        pairs = zip(geometries, poses, strict=True)
        computed = np.stack([mechanism.inverse(geometry, branch, at) for geometry, at in pairs])
        distance = np.abs(np.nan_to_num(computed - measured, nan=np.inf)).max(axis=-1)
        choice, rows = np.argmin(distance, axis=0), np.arange(len(commands))
        chosen = PoseBatch(
            np.stack([each.positions for each in poses])[choice, rows],
            np.stack([each.rotations for each in poses])[choice, rows],
        )
        return cls(mechanism, branch, chosen, geometries, choice, computed[choice, rows])

    def are_of(self, candidates: Sequence[CommandingGeometry]) -> bool:
        """Whether they were attributed to the very same geometries."""
        own, others = self.candidate_geometries, [one.geometry for one in candidates]
        return len(own) == len(others) and all(map(operator.is_, own, others))

    def with_others(self, known: NDArray[np.intp], others: CommandedPoses) -> CommandedPoses:
        """These commands and others in one order: ``known`` (n,) are rows of these, or -1 for others."""
        new = known < 0
        choice, joints = self.choice[known], self.joints[known]
        choice[new], joints[new] = others.choice, others.joints
        poses = self.poses[known].with_rows(new, others.poses)
        return replace(self, poses=poses, choice=choice, joints=joints)

    @property
    def most_frequent_geometry(self) -> Geometry:
        """The geometry that commanded most of the records."""
        counts = np.bincount(self.choice, minlength=len(self.candidate_geometries))
        return self.candidate_geometries[int(np.argmax(counts))]

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> CommandedPoses:
        return replace(self, poses=self.poses[rows], choice=self.choice[rows], joints=self.joints[rows])

    def joined(self, other: CommandedPoses) -> CommandedPoses:
        """The commands of both."""
        return replace(
            self,
            poses=PoseBatch.joined([self.poses, other.poses]),
            candidate_geometries=(*self.candidate_geometries, *other.candidate_geometries),
            choice=np.concatenate([self.choice, other.choice + len(self.candidate_geometries)]),
            joints=np.concatenate([self.joints, other.joints]),
        )

    def solve_poses(self, geometry: Geometries, joints: Array) -> ForwardResult:
        """Poses that close ``geometry`` at joint variables (n, 6), mm, near the commanded ones.

        It is one geometry for all records, or one for each.
        """
        poses = self.poses
        found = np.zeros(len(joints), dtype=bool)
        for choice, commanding in enumerate(self.candidate_geometries):
            rows = np.flatnonzero((self.choice == choice) & np.isfinite(self.joints).all(axis=-1))
            if not len(rows):
                continue
            result = continue_solution(
                self.mechanism,
                geometry.subset(rows) if isinstance(geometry, GeometryBatch) else geometry,
                joints[rows],
                start=self.poses[rows],
                start_geometry=commanding,
                start_joints=self.joints[rows],
                stage_counts=SAME_GEOMETRY_STAGES if commanding is geometry else CONTINUATION_STAGES,
            )
            poses = poses.with_rows(rows, result.poses)
            found[rows] = result.found
        return ForwardResult(poses, found)


def require_consistent_encoders(
    commands: CommandedPoses, measured: Array, labels: NDArray[np.int_], prior: Prior
) -> None:
    """Require that a geometry within the tolerances explains the joint variables of n records.

    The joint variables q are the inverse kinematics of the commanded pose under the geometry that the
    controller had at that time. That geometry may be unknown, but it was within the drawing's tolerances.
    Its effect on q is bounded by worst-case tolerance analysis: the sum, over the parameters of a leg, of
    the larger change of q at the two ends of the tolerance. A few inconsistent records are accepted; the
    search for data faults names them.

    Raises:
        IdentifiabilityError: names the first record and its worst leg, and the columns that look exchanged,
            if any.
    """
    # NaN is a pose out of reach, which the start poses report.
    difference = np.nan_to_num(np.abs(measured - commands.joints), nan=0.0)
    if _is_small_share(difference > ACCEPTED_MM):
        return
    explained = _explained_by_tolerances(commands, prior)
    if _is_small_share(difference > explained):
        return
    inconsistent = np.logical_or.reduce(difference > explained, axis=-1)
    first = int(np.argmax(inconsistent))
    leg = int(np.argmax(difference[first] - explained[first]))
    point, orientation = labels[first]
    raise IdentifiabilityError(
        f"in {np.count_nonzero(inconsistent)} of {len(labels)} records the joint variables do not belong "
        f"to the commanded pose; the first is point {point}, orientation {orientation}, where q{leg + 1} "
        f"is {difference[first, leg]:.1f} mm off, and the tolerances explain "
        f"{explained[first, leg]:.1f} mm",
        action=_advice(commands, measured, explained),
    )


def _is_small_share(legs: Mask) -> bool:
    """Whether any leg (n, 6) is concerned in few of n records only."""
    return bool(np.count_nonzero(legs.any(axis=-1)) <= MAX_OUTLIER_SHARE * len(legs))


def _explained_by_tolerances(commands: CommandedPoses, prior: Prior) -> Array:
    """Bound (n, 6), mm, of the tolerances' effect on each joint variable; infinite if out of reach."""
    widths = prior.leg_widths(commands.mechanism)
    parameters = prior.centre.parameters

    def commanded(change: Array) -> Array:
        geometry = Geometry(parameters, prior.centre.vector + parameters.of_every_row(change))
        return commands.mechanism.inverse(geometry, commands.branch, commands.poses)

    at_drawing = commanded(np.zeros(len(widths)))
    changes = np.zeros_like(at_drawing)
    for parameter in np.diag(widths):
        changes += np.maximum(*(np.abs(commanded(sign * parameter) - at_drawing) for sign in (-1.0, 1.0)))
    return np.nan_to_num(changes, nan=np.inf)


def _advice(commands: CommandedPoses, measured: Array, explained: Array) -> str:
    # The import takes a sixth of the start-up time, and only wrong columns need it.
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415

    # The column that fits each leg's commands best.
    reached = np.isfinite(commands.joints).all(axis=-1)
    distance = np.abs(measured[reached][:, None, :] - commands.joints[reached][:, :, None])
    columns = linear_sum_assignment(np.median(distance, axis=0))[1].tolist()
    difference = np.nan_to_num(np.abs(measured[:, columns] - commands.joints), nan=0.0)
    if not _is_small_share(difference > explained):
        where = f"q1 to q{len(columns)} are in the row of their pose, in mm"
        return f"Check that {where}, and which config commanded it"
    moved = [leg for leg, column in enumerate(columns) if column != leg]
    names = ", ".join(f"q{leg + 1}" for leg in moved)
    sources = ", ".join(f"q{columns[leg] + 1}" for leg in moved)
    joint = commands.mechanism.words.joint
    return f"The columns {names} look like those of {sources}: check which encoder is on which {joint}"
