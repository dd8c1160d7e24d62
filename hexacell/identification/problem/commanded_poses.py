"""Where the forward kinematics of each record begins: at the commanded pose.

A pose belongs to the geometry that commanded it. That is the controller's, unless the records are
older than its last calibration; then it was, as a rule, the drawing's. Each record is believed to
come from the geometry whose inverse kinematics is nearest to its encoders, and is followed from
there to any other geometry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.forward import CONTINUATION_STAGES, ForwardResult, continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

AT_HOME = (1, *CONTINUATION_STAGES)
"""Stages of the continuation where the geometry stays: joint variables differ little from the commanded."""


@dataclass(frozen=True, slots=True, eq=False)
class CommandedPoses:
    """What n records were commanded with.

    Attributes:
        poses: as the controller was told.
        candidate_geometries: geometries that may have commanded them.
        choice: (n,) which of these did.
        joints: (n, 6), mm, that it computed; NaN where none of them reaches the pose.
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
        poses: PoseBatch,
        candidate_geometries: Sequence[Geometry],
        branch: Branch,
        measured: Array,
    ) -> CommandedPoses:
        """Poses commanded under one of some geometries, and the measured joint variables (n, 6), mm."""
        computed = np.stack(
            [mechanism.inverse(geometry, branch, poses) for geometry in candidate_geometries]
        )
        distance = np.abs(np.nan_to_num(computed - measured, nan=np.inf)).max(axis=-1)
        choice = np.argmin(distance, axis=0)
        return cls(mechanism, poses, candidate_geometries, choice, computed[choice, np.arange(len(poses))])

    @property
    def most_frequent_geometry(self) -> Geometry:
        """The geometry that commanded most of the records."""
        counts = np.bincount(self.choice, minlength=len(self.candidate_geometries))
        return self.candidate_geometries[int(np.argmax(counts))]

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> CommandedPoses:
        return CommandedPoses(
            self.mechanism,
            self.poses[rows],
            self.candidate_geometries,
            self.choice[rows],
            self.joints[rows],
        )

    def solve_poses(self, geometry: Geometry, joints: Array) -> ForwardResult:
        """Poses that close ``geometry`` at joint variables (n, 6), mm, near the commanded ones."""
        positions, rotations = np.array(self.poses.positions), np.array(self.poses.rotations)
        found = np.zeros(len(joints), dtype=bool)
        for choice, commanding in enumerate(self.candidate_geometries):
            rows = np.flatnonzero((self.choice == choice) & np.isfinite(self.joints).all(axis=-1))
            if not len(rows):
                continue
            result = continue_solution(
                self.mechanism,
                geometry,
                joints[rows],
                start=self.poses[rows],
                start_geometry=commanding,
                start_joints=self.joints[rows],
                tries=AT_HOME if commanding is geometry else CONTINUATION_STAGES,
            )
            positions[rows], rotations[rows] = result.poses.positions, result.poses.rotations
            found[rows] = result.found
        return ForwardResult(PoseBatch(positions, rotations), found)
