"""How good the choice of poses is: campaigns against the best continuous design for a robot that is known.

The best designs are compared with known ones and with poses that took no part, and the sensitivities, on
which their certificates rest, with finite differences.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from hexacell.campaign.planner import Plan
from hexacell.campaign.task_accuracy import Task
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import VirtualRobot, random_robot
from tests.benchmarks.continuous_design import (
    Criterion,
    Design,
    PointDesign,
    Slopes,
    best_design,
    best_weights,
    design_of,
    possible_targets,
    whitened,
)
from tests.benchmarks.figures import at_least
from tests.benchmarks.machines import on_all_cores, with_aligned_gauges
from tests.benchmarks.samples import sample
from tests.small_cell import changed

SEED = 18
ROBOTS = sample(__name__, "ROBOTS")
LEAST = 0.90
"""The target of the median by D; missed by 0.01 as last measured (docs/measured.md)."""
D_GAP, I_GAP = 0.005, 0.03
"""Shares by which a better design may exceed the best one that was found."""
UNSEEN, BEYOND = 4096, 0.02
"""Poses that took no part, and what they may exceed a certificate by."""
GAP = 1e-5
GRID = np.unique(np.concatenate([np.linspace(-1.0, 1.0, 201), [-np.sqrt(0.2), np.sqrt(0.2)]]))


@dataclass(frozen=True, slots=True)
class Rating:
    """Certified efficiencies by D and by I, the certificates, and what unseen poses leave of the first."""

    d: float
    i: float
    certificates: tuple[float, float]
    unseen: float


def rated(number: int) -> Rating | None:
    """A robot's adaptive campaign beside the best designs; None if it cannot be calibrated."""
    cell = with_aligned_gauges()
    model = robot_of(cell)
    truth = random_robot(
        model.mechanism, model.drawing, model.tolerances, np.random.default_rng([SEED, number])
    )
    # Where every record takes as long, as the best continuous designs have it.
    in_no_time = {"speed.joint_at_gauges": 1e6, "speed.edge_at_gauges_mm_s": 1e6}
    plan = Plan(changed(cell.settings, in_no_time), model, with_forecast=False)
    try:
        random = np.random.default_rng([SEED, number, 1])
        campaign = VirtualCampaign(plan, VirtualRobot(model, truth, random))
        campaign.carry_out()
        model = campaign.plan.robot
        found = identify(model.problem(campaign.measurements), find_outliers=False)
    except HexacellError:
        return None
    belief = model.belief(found)
    error = Task.of(cell.settings, model, belief).error(belief)
    assert error is not None
    start, domains = design_of(belief, found)
    reached = found.solution.information + start.prior
    np.testing.assert_allclose(start.information()[0], reached, rtol=1e-6, atol=1e-3)
    by_d, certificate = best_design(start, domains, Criterion(), D_GAP)
    at = Slopes.at(by_d, Criterion())
    spread = [domain.records(possible_targets(belief, domain.zero, UNSEEN, 999)) for domain in domains]
    of_task = Criterion(error.jacobian.reshape(-1, len(belief.free)))
    by_i, of_i = best_design(by_d, domains, of_task, I_GAP)
    return Rating(
        certificate * Criterion().efficiency(reached, by_d.information()[0]),
        of_i * of_task.efficiency(reached, by_i.information()[0]),
        (certificate, of_i),
        at.certificate(spread),
    )


def test_the_efficiency_of_adaptive_campaigns(figure) -> None:
    found = [one for one in on_all_cores(rated, range(ROBOTS)) if one is not None]
    assert len(found) >= 0.95 * ROBOTS
    for name, values, target in (
        ("D", [one.d for one in found], at_least(LEAST)),
        ("I", [one.i for one in found], None),
    ):
        tenth, median = np.quantile(values, [0.1, 0.5])
        figure(f"{name}-efficiency of {len(values)} robots, certified, median", median, "", target)
        figure(f"  {name}: a tenth are below", tenth)
    for name, least in zip("DI", np.min([one.certificates for one in found], axis=0), strict=True):
        figure(f"the least certificate, {name}", least, "", at_least(0.97))
    unseen = min(one.unseen - one.certificates[0] for one in found)
    figure("  D: what poses that took no part leave of it", unseen, "", at_least(-BEYOND))


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_d_optimal_designs_of_polynomials_are_the_known_ones(degree) -> None:
    """Equal weights at the ends and the extremes of a Legendre polynomial (Guest 1958, Hoel 1958)."""
    powers = np.stack([GRID**power for power in range(degree + 1)], axis=-1)[:, None]
    start = PointDesign(powers[:0], powers, np.full(len(GRID), 1.0 / len(GRID)))
    [point] = best_weights(Design((start,), np.zeros((degree, degree))), Criterion(), GAP).points
    extremes = np.polynomial.legendre.Legendre.basis(degree).deriv().roots()
    for place in (-1.0, *extremes, 1.0):
        near = np.abs(GRID - place) < 0.03
        assert point.weights[near].sum() == pytest.approx(1.0 / (degree + 1), abs=0.01)


PREDICTIONS = np.array([[1.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])


@pytest.mark.parametrize("criterion", [Criterion(), Criterion(PREDICTIONS)], ids=["D", "I"])
def test_sensitivities_are_the_slopes_of_the_criterion(criterion) -> None:
    """Of two points of records with unequal noise, three coordinates and four parameters."""
    random, step = np.random.default_rng(0), 1e-6
    roots = np.eye(3) + 0.4 * random.standard_normal((2, 12, 3, 3))
    jacobians = random.standard_normal((2, 12, 3, 4))
    every = [whitened(*one) for one in zip(jacobians, np.swapaxes(roots, -1, -2) @ roots, strict=True)]
    points = [PointDesign(one[:1], one, random.uniform(0.1, 0.5, 12)) for one in every]
    prior = 0.1 * np.eye(4)

    def value(weights: Array) -> float:
        first = replace(points[0], weights=weights)
        information = Design((first, points[1]), prior).information()[0]
        if criterion.predictions is None:
            return float(np.linalg.slogdet(information)[1])
        return -float(np.trace(PREDICTIONS @ np.linalg.solve(information, PREDICTIONS.T)))

    slopes = Slopes.at(Design(tuple(points), prior), criterion).sensitivities(0, every[0])
    weights = points[0].weights
    ahead, behind = (
        np.array([value(weights + sign * step * row) for row in np.eye(12)]) for sign in (1.0, -1.0)
    )
    np.testing.assert_allclose(slopes, (ahead - behind) / (2.0 * step), rtol=1e-6)
