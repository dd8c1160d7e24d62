"""The same estimate by a compiled peer: CasADi with its automatic derivatives, solved by IPOPT.

The peer gets the problem in the form that suits it best: poses and each point's constant are
unknowns beside the 35 parameters, the legs are constraints, derivatives of first and second order
are exact and sparse, and our final weights are given to it. Building its expressions is not timed.
"""

from __future__ import annotations

import time

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import measurement_model
from hexacell.study import data_sets
from tests.benchmarks.figures import at_least, at_most


@pytest.fixture
def casadi():
    """The peer; an extra of its own, since nothing but this comparison needs it."""
    return pytest.importorskip("casadi", reason="make bench installs it")


def peer(casadi, problem: Problem, weights: np.ndarray):
    """A CasADi solver of the weighted problem, and where it starts."""
    parameters = casadi.SX.sym("parameters", 35)
    vector = casadi.DM(problem.basis) @ parameters
    from tests.benchmarks.peers import casadi_poses  # which needs CasADi

    constants = [casadi.SX.sym(f"c{point}", 3) for point in range(problem.points)]
    unknowns, start = [parameters], [problem.prior.free]
    legs, residuals = [], []
    points = np.cumsum(np.isin(np.arange(problem.records), problem.first_rows)) - 1
    factors = np.swapaxes(np.linalg.cholesky(weights), 1, 2)
    for row in range(problem.records):
        position, turn = casadi.SX.sym(f"P{row}", 3), casadi.SX.sym(f"w{row}", 3)
        rotation = casadi_poses.rotation_of(turn) @ casadi.DM(problem.start.rotations[row])
        joints = casadi.DM(problem.joints[row])
        legs.append(casadi_poses.closed_legs(vector, position, rotation, joints))
        deviation = casadi.DM(problem.deviations[row])
        residuals.append(casadi.DM(factors[row]) @ (position - deviation - constants[points[row]]))
        unknowns += [position, turn]
        start += [problem.start.positions[row], np.zeros(3)]
    start += [problem.start.positions[row] for row in problem.first_rows]
    program = {
        "x": casadi.vertcat(*unknowns, *constants),
        "f": casadi.sumsqr(casadi.vertcat(*residuals)) / 2,
        "g": casadi.vertcat(*legs),
    }
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0, "ipopt.tol": 1e-8}
    return casadi.nlpsol("peer", "ipopt", program, options), np.concatenate(start)


def test_no_slower_than_the_compiled_peer(casadi, table_one, figure) -> None:
    random = np.random.default_rng(20)
    campaign = data_sets.unlimited_travel(
        table_one.robot, table_one.truth, table_one.points, 20, np.radians(20), random
    )
    problem = table_one.robot.problem(campaign.measured(0.01, random))
    found = identify(problem)
    weights = measurement_model.predict(found.problem, found.free, found.poses).weights
    solver, start = peer(casadi, problem, weights)
    theirs, ours = [], []
    for _ in range(5):
        begun = time.process_time()
        solution = solver(x0=start, lbg=0, ubg=0)
        theirs.append(time.process_time() - begun)
        begun = time.process_time()
        identify(problem)
        ours.append(time.process_time() - begun)
    apart = np.abs(np.asarray(solution["x"]).ravel()[:35] - found.free).max()
    ratio = min(theirs) / min(ours)
    figure("CasADi and IPOPT, compiled, exact derivatives, 5x20: times as long", ratio, "", at_least(1.0))
    figure("  its solution differs from ours by", apart, "mm", at_most(1e-4))
