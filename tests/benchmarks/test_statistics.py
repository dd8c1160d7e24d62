"""The errors of the estimator: against the Cramer-Rao bound, beside the paper's, and from any drawing.

1,000 data sets of the Table 1 robot, 5 points x 11 orientations within +-30 deg, 0.01 mm noise on
joint variables and deviations: errors against the Cramer-Rao bound, which is computed here from
central differences and not from the estimator's derivatives.
"""

from dataclasses import dataclass, replace

import numpy as np

from hexacell.errors import ConvergenceError, LimitError
from hexacell.identification.estimator import identify
from hexacell.kinematics.forward import continue_solution, forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.rotations import Array
from hexacell.robot.virtual_robot import random_robot
from hexacell.study import data_sets
from hexacell.study.reference_solvers import gauss_newton
from tests.benchmarks.figures import NEVER, at_least, at_most, between
from tests.benchmarks.samples import sample
from tests.records_within_travel import within_travel

SETS, PAIRED, ROBOTS = (sample(__name__, name) for name in ("SETS", "PAIRED", "ROBOTS"))
SIGMAS = 6.0
NOISE_MM = 0.01
STEP_MM = 1e-4


@dataclass(frozen=True)
class Outcome:
    """Errors (sets, 35), whether 95 % intervals cover (sets, 35), and the bound (35,)."""

    errors: Array
    covered: Array
    bound: Array
    removed: int
    records: int


def outcome_of(table_one) -> Outcome:
    robot, truth = table_one.robot, table_one.truth
    random = np.random.default_rng(1)
    campaign = data_sets.unlimited_travel(robot, truth, table_one.points, 11, np.radians(30), random)
    free = robot.mechanism.convention.free_parameters(truth)
    errors, covered, removed = [], [], 0
    for _ in range(SETS):
        found = identify(robot.problem(campaign.measured(NOISE_MM, random)))
        error = found.free - free
        errors.append(error)
        covered.append(np.abs(error) <= 1.959964 * np.sqrt(np.diag(found.free_covariance)))
        removed += len(found.left_out)
    bound = cramer_rao_bound(robot, truth, campaign)
    return Outcome(np.array(errors), np.array(covered), bound, removed, SETS * len(campaign.joints))


def cramer_rao_bound(robot, truth: Geometry, campaign: data_sets.DataSet) -> Array:
    """Smallest standard deviations (35,) of an unbiased estimator, mm."""
    positions = _position_of(robot, truth, campaign)
    by_joints = _by_joints(lambda joints: positions(truth, joints), campaign.joints)
    basis = robot.mechanism.convention.basis
    vector = truth.vector.copy()
    columns = []
    for column in basis.T:
        ahead, behind = (
            positions(Geometry(HEXAGLIDE_PARAMETERS, vector + sign * STEP_MM * column), campaign.joints)
            for sign in (1, -1)
        )
        columns.append((ahead - behind) / (2 * STEP_MM))
    by_free = np.stack(columns, axis=-1)
    covariance = NOISE_MM**2 * (by_joints @ np.swapaxes(by_joints, 1, 2) + np.eye(3))
    information = np.zeros((35, 35))
    for point in np.unique(campaign.labels[:, 0]):
        rows = np.flatnonzero(campaign.labels[:, 0] == point)
        weights = np.linalg.inv(covariance[rows])
        # The point's unknown constant is a parameter like the others, eliminated by Schur's complement.
        cross = np.einsum("nij,njp->ip", weights, by_free[rows])
        information += np.einsum("nip,nij,njr->pr", by_free[rows], weights, by_free[rows])
        information -= cross.T @ np.linalg.solve(weights.sum(axis=0), cross)
    return np.sqrt(np.diag(np.linalg.inv(information)))


def _position_of(robot, truth, campaign):
    really = continue_solution(
        robot.mechanism,
        truth,
        campaign.joints,
        start=campaign.commands,
        start_geometry=robot.controller,
        start_joints=campaign.joints,
    ).poses

    def positions(geometry: Geometry, joints: Array) -> Array:
        return forward_kinematics(robot.mechanism, geometry, joints, really).poses.positions

    return positions


def _by_joints(positions, joints: Array) -> Array:
    columns = []
    for leg in range(6):
        step = np.zeros(6)
        step[leg] = STEP_MM
        columns.append((positions(joints + step) - positions(joints - step)) / (2 * STEP_MM))
    return np.stack(columns, axis=-1)


def test_errors_and_intervals_are_those_of_the_cramer_rao_bound(table_one, figure) -> None:
    outcome = outcome_of(table_one)
    ratio = np.sqrt(np.mean(outcome.errors**2, axis=0)) / outcome.bound
    figure("rms error / Cramer-Rao bound, median of 35", np.median(ratio), "", between(0.98, 1.03))
    figure("  smallest", ratio.min(), "", at_least(0.92))
    figure("  largest", ratio.max(), "", at_most(1.08))
    each = 100 * outcome.covered.mean(axis=0)
    figure("95 % intervals cover, pooled", each.mean(), "%", between(94.0, 96.0))
    figure("  least covered parameter", each.min(), "%", at_least(92.5))
    figure("  most covered parameter", each.max(), "%", at_most(97.5))
    share = 100 * outcome.removed / outcome.records
    figure("clean records taken for gross errors", share, "%", at_most(0.1))


def test_error_is_at_least_halved(table_one, figure) -> None:
    """Records as the paper simulates them: kept if they can be reached, however near a singularity."""
    robot, truth = table_one.robot, table_one.truth
    anywhere = replace(robot, limits=replace(robot.limits, singularity_margin=0.0))
    ours, paper, diverged = [], [], 0
    for seed in range(PAIRED):
        random = np.random.default_rng(seed)
        campaign = data_sets.unlimited_travel(anywhere, truth, table_one.points, 11, np.radians(30), random)
        problem = robot.problem(campaign.measured(0.01, random))
        found = identify(problem)
        ours.append(found.geometry.largest_difference(truth))
        try:
            paper.append(gauss_newton(problem).largest_difference(truth))
        except ConvergenceError:
            # From the drawing it does not always arrive; its minimum is then looked for from ours.
            diverged += 1
            paper.append(
                gauss_newton(found.problem.starting_at(found.free, found.poses)).largest_difference(truth)
            )
    before, after = np.median(paper), np.median(ours)
    figure("largest parameter error, median: paper's least squares", before, "mm")
    figure("  ours on the same records", after, "mm")
    figure("  ours over the paper's", after / before, "", at_most(0.5))
    figure(f"  data sets of {PAIRED} on which eq. 13 diverges from the drawing", diverged)


def test_every_robot_is_found(table_one, figure) -> None:
    """From the drawing, whatever its errors within +-7 mm are."""
    robot = table_one.robot
    unreachable, failed, wrong, short = 0, 0, 0, 0
    for seed in range(ROBOTS):
        random = np.random.default_rng(seed)
        truth = random_robot(robot.mechanism, robot.drawing, robot.tolerances, random)
        try:
            campaign = within_travel(robot, truth, table_one.points, 11, np.radians(30), random)
        except LimitError:
            unreachable += 1
            continue
        found = identify(robot.problem(campaign.measured(0.01, random)))
        error = np.abs(found.free - robot.mechanism.convention.free_parameters(truth))
        failed += not found.termination.converged
        wrong += bool((error > SIGMAS * np.sqrt(np.diag(found.free_covariance))).any())
        short += found.records < len(campaign.joints)
    figure(f"of {ROBOTS} robots with +-7 mm errors: points out of reach, left out", unreachable)
    figure("  of the others did not converge from the drawing", failed, "", NEVER)
    figure("  farther than 6 sigma from the truth (a wrong mode)", wrong, "", NEVER)
    figure("  identified without one or two records next to a singularity", short)
