"""The solver around singularities that lie between the start and the solution.

During the iteration the pose of a record may come next to a singularity although it is far from one
at the start and at the solution. Or a singularity lies between the geometry that commanded the
record and the start, so that the record has no start pose. Such a record would stop the iteration.
It is therefore set aside, the others are solved, and it is restored at their solution, where its pose
is continued from the commanded one. A record that cannot be restored is left out.

Source of the singularities: Gosselin and Angeles, Singularity analysis of closed-loop kinematic chains,
IEEE Transactions on Robotics and Automation 6, 1990. Setting records aside is this program's own method.
"""

from __future__ import annotations

import itertools

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import levenberg_marquardt
from hexacell.identification.solver.levenberg_marquardt import Solution, SolverOptions, Termination
from hexacell.identification.solver.measurement_model import is_singular
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import pose_sensitivity


def solve_around_singularities(
    problem: Problem, precision: Array, options: SolverOptions
) -> tuple[Problem, Solution]:
    """As :func:`levenberg_marquardt.solve`, from the problem's start; returns the records used as well."""
    used = problem.has_start_pose.copy()
    free, poses = problem.initial_parameters, problem.start[used]
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
        every = problem.start.with_rows(used, poses).with_rows(restorable, their_poses)
        used, restored = used | restorable, restored | restorable
        poses = every[used]
    return kept, solution


def _restorable(problem: Problem, free: Array, aside: Mask) -> tuple[Mask, PoseBatch]:
    """Which of the records set aside are clear of singularities at a geometry, and their poses."""
    some = problem.subset(aside)
    solved = some.solve_poses(free)
    sensitivity = pose_sensitivity(some.mechanism, some.geometry(free), solved.poses, some.joints)
    clear = solved.found & ~is_singular(sensitivity.joints[:, :3])
    restorable = np.zeros(problem.records, dtype=bool)
    restorable[aside] = clear
    return restorable, solved.poses[clear]
