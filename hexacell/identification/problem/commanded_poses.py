"""The commanded poses of records: the start of their forward kinematics.

A pose is commanded under a geometry and in its frames: those of the controller, or those of before if the
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

from hexacell.kinematics.forward import CONTINUATION_STAGES, ForwardResult, continue_solution
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.mechanism import Branch, FrameTransform, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

SAME_GEOMETRY_STAGES = (1, *CONTINUATION_STAGES)
"""Continuation stages under the commanding geometry: the joint variables are near the commanded ones."""


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
    """The commands of n records.

    Attributes:
        poses: the commanded poses, in the convention's frames.
        candidate_geometries: geometries that may have commanded them.
        choice: (n,) the index of the one that did.
        joints: (n, 6), mm, its inverse kinematics; NaN where no candidate reaches the pose.
    """

    mechanism: Mechanism
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
        computed = np.stack(
            [mechanism.inverse(one, branch, at) for one, at in zip(geometries, poses, strict=True)]
        )
        distance = np.abs(np.nan_to_num(computed - measured, nan=np.inf)).max(axis=-1)
        choice, rows = np.argmin(distance, axis=0), np.arange(len(commands))
        chosen = PoseBatch(
            np.stack([each.positions for each in poses])[choice, rows],
            np.stack([each.rotations for each in poses])[choice, rows],
        )
        return cls(mechanism, chosen, geometries, choice, computed[choice, rows])

    def are_of(self, candidates: Sequence[CommandingGeometry]) -> bool:
        """Whether they were attributed to the very same geometries."""
        own, others = self.candidate_geometries, [one.geometry for one in candidates]
        return len(own) == len(others) and all(map(operator.is_, own, others))

    def with_others(self, known: NDArray[np.intp], others: CommandedPoses) -> CommandedPoses:
        """These and others in one order: ``known`` (n,) are rows of these, and -1 where others are."""
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
            poses=PoseBatch.concatenate([self.poses, other.poses]),
            candidate_geometries=(*self.candidate_geometries, *other.candidate_geometries),
            choice=np.concatenate([self.choice, other.choice + len(self.candidate_geometries)]),
            joints=np.concatenate([self.joints, other.joints]),
        )

    def solve_poses(self, geometry: Geometry | GeometryBatch, joints: Array) -> ForwardResult:
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
