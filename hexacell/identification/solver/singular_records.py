"""The solver around singularities that lie between the start and the solution.

During the iteration the pose of a record may come next to a singularity although it is far from one
at the start and at the solution. Or a singularity lies between the geometry that commanded the
record and the start, so that the record has no start pose. Such a record would stop the iteration.
It is therefore set aside, the others are solved, and it is restored at their solution, where its pose
is continued from the commanded one. A record that cannot be restored is left out.
"""

from __future__ import annotations

import itertools

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import levenberg_marquardt
from hexacell.identification.solver.levenberg_marquardt import COARSE, Solution, SolverOptions, Termination
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import pose_sensitivity


def solve_around_singularities(
    problem: Problem, precision: Array, *, free: Array, poses: PoseBatch, options: SolverOptions = COARSE
) -> tuple[Problem, Solution]:
    """As :func:`levenberg_marquardt.solve`; returns the problem of the records used as well.

    ``poses`` of the n records are valid where ``problem.has_start_pose``.
    """
    used = problem.has_start_pose.copy()
    poses = poses[used]
    restored = np.zeros(problem.records, dtype=bool)
    for search in itertools.count(1):
        kept = problem.subset(used)
        solution = levenberg_marquardt.solve(kept, precision, free=free, poses=poses, options=options)
        if search == options.searches:
            break
        free, poses = solution.free, solution.prediction.poses
        if solution.termination is Termination.SINGULAR and not solution.singular.all():
            used[np.flatnonzero(used)[solution.singular]] = False
            poses = poses[~solution.singular]
            continue
        aside = ~used & ~restored
        if not aside.any():
            break
        restorable, their_poses = _restorable(problem, free, aside)
        if not restorable.any():
            break
        poses = _merged(problem.records, used, poses, restorable, their_poses)
        used, restored = used | restorable, restored | restorable
        poses = poses[used]
    return kept, solution


def _restorable(problem: Problem, free: Array, aside: Mask) -> tuple[Mask, PoseBatch]:
    """Which of the records set aside are clear of singularities at a geometry, and their poses."""
    geometry = problem.mechanism.convention.geometry(free)
    rows = np.flatnonzero(aside)
    found = problem.commands[rows].solve_poses(geometry, problem.joints[rows])
    by_joints = pose_sensitivity(problem.mechanism, geometry, found.poses, problem.joints[rows]).joints[
        :, :3
    ]
    clear = np.linalg.norm(by_joints, axis=(-2, -1)) < levenberg_marquardt.LARGEST_AMPLIFICATION
    restorable = np.zeros(problem.records, dtype=bool)
    restorable[rows] = found.found & clear
    return restorable, found.poses[found.found & clear]


def _merged(records: int, used: Mask, poses: PoseBatch, others: Mask, other_poses: PoseBatch) -> PoseBatch:
    """The poses of all records (n,), those of neither mask zero."""
    positions, rotations = np.zeros((records, 3)), np.zeros((records, 3, 3))
    positions[used], rotations[used] = poses.positions, poses.rotations
    positions[others], rotations[others] = other_poses.positions, other_poses.rotations
    return PoseBatch(positions, rotations)
