"""Around the singularities that lie between the drawing and the solution.

On the way from the drawing a record may come next to a singularity although it is far from one at
both ends; or one may lie between the geometry that commanded it and the drawing, so that it cannot
even begin there. Held in the sum, such a record stops the whole iteration. It is therefore set
aside, the others lead the way, and it is taken back at their solution, where its pose is followed
from the commanded one by continuation. A record that cannot be taken back stays out.
"""

from __future__ import annotations

import itertools

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import levenberg_marquardt
from hexacell.identification.solver.levenberg_marquardt import COARSE, Solution, SolverOptions, Termination
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import pose_sensitivity


def solve_around_singularities(
    problem: Problem, precision: Array, *, free: Array, poses: PoseBatch, manner: SolverOptions = COARSE
) -> tuple[Problem, Solution]:
    """As :func:`levenberg_marquardt.solve`; also gives the records that took part in the end.

    ``poses`` counts where ``problem.has_start_pose`` says so.
    """
    used = problem.has_start_pose.copy()
    poses = poses[used]
    taken_back = np.zeros(problem.records, dtype=bool)
    for search in itertools.count(1):
        kept = problem.subset(used)
        solution = levenberg_marquardt.solve(kept, precision, free=free, poses=poses, manner=manner)
        if search == manner.searches:
            break
        free, poses = solution.free, solution.prediction.poses
        if solution.termination is Termination.SINGULAR and not solution.singular.all():
            used[np.flatnonzero(used)[solution.singular]] = False
            poses = poses[~solution.singular]
            continue
        aside = ~used & ~taken_back
        if not aside.any():
            break
        returning, everywhere = _returning(problem, free, aside)
        if not returning.any():
            break
        poses = _merged(problem.records, used, poses, returning, everywhere)
        used, taken_back = used | returning, taken_back | returning
        poses = poses[used]
    return kept, solution


def _returning(problem: Problem, free: Array, aside: Mask) -> tuple[Mask, PoseBatch]:
    """Which of the records set aside stand clear of singularities at a geometry, and their poses."""
    geometry = Geometry.from_vector(problem.basis @ free)
    rows = np.flatnonzero(aside)
    found = problem.commands[rows].solve_poses(geometry, problem.joints[rows])
    by_joints = pose_sensitivity(problem.mechanism, geometry, found.poses, problem.joints[rows]).joints[
        :, :3
    ]
    clear = np.linalg.norm(by_joints, axis=(-2, -1)) < levenberg_marquardt.LARGEST_AMPLIFICATION
    returning = np.zeros(problem.records, dtype=bool)
    returning[rows] = found.found & clear
    return returning, found.poses[found.found & clear]


def _merged(records: int, used: Mask, poses: PoseBatch, returning: Mask, back: PoseBatch) -> PoseBatch:
    positions, rotations = np.zeros((records, 3)), np.zeros((records, 3, 3))
    positions[used], rotations[used] = poses.positions, poses.rotations
    positions[returning], rotations[returning] = back.positions, back.rotations
    return PoseBatch(positions, rotations)
