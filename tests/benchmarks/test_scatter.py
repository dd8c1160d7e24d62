"""Machines whose joints scatter: all end with a result, U covers one round of visits, none passes falsely.

Robots are drawn within the tolerances of the bundled cell. Their noise is measured first, and the gates are
those of a run. The true error is that of one round of visits to the task poses, whose scatter is drawn.
"""

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import pytest

from hexacell.campaign.task_accuracy import Task
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.sensitivity import free_sensitivity
from hexacell.robot.model import Robot, robot_of
from tests.benchmarks.figures import NEVER, at_least, at_most, least_by_chance
from tests.benchmarks.machines import on_all_cores, with_gauges_of
from tests.benchmarks.samples import sample
from tests.benchmarks.virtual_calibration import Judged, Scatter, judged, robot_that_stands

MACHINES = sample(__name__, "MACHINES")
SCATTERS = (
    *((Scatter(seen=mm), 10.0) for mm in (0.02, 0.05, 0.1, 0.2)),
    (Scatter(seen=0.5), 50.0),
    *((Scatter(unseen=mm), 10.0) for mm in (0.02, 0.05, 0.1)),
    (Scatter(unseen=0.2), 20.0),
)
"""And the travel of the gauges, mm."""


@dataclass(frozen=True)
class InOneRound:
    """The largest position error in one round of visits to the task poses, whose scatter is drawn.

    ``squares`` are those of the errors of the geometry alone, mm^2, and what the noise found has them be.
    """

    scatter: Scatter
    random: np.random.Generator
    squares: list[tuple[float, float]] = field(default_factory=list)

    def __call__(self, after: Robot, truth: Geometry, found: Identification, task: Task) -> float:
        budget = task.budget(found, after.belief(found), after.effects, {})
        assert budget is not None
        off = found.free - after.mechanism.convention.free_parameters(truth)
        actual = after.commanded(truth).actual_poses(task.poses)
        by_joints = free_sensitivity(after.mechanism, truth, actual.poses, actual.joints, 3).joints
        size = float(np.hypot(self.scatter.seen, self.scatter.unseen))
        stops = size * self.random.standard_normal((len(by_joints), 6))
        by_geometry = budget.errors_of(off).estimated[:, :3]
        self.squares.append((float(np.sum(by_geometry**2)), float(np.sum(budget.noise[:, :3] ** 2))))
        errors = by_geometry + np.einsum("nij,nj->ni", by_joints, stops)
        return float(np.linalg.norm(errors, axis=-1).max())


def calibrated(scatter: Scatter, gauges_mm: float, number: int) -> tuple[Judged, list[tuple[float, float]]]:
    cell, random = with_gauges_of(gauges_mm), np.random.default_rng([37, number])
    robot = robot_of(cell)
    truth = robot_that_stands(cell, robot, random)
    in_one_round = InOneRound(scatter, random)
    one = judged(cell, robot, truth, random, in_one_round, scatter)
    # What it consists of cannot be sent to another process.
    return replace(one, done=None), in_one_round.squares


def named(scatter: Scatter) -> str:
    return f"{scatter.seen:g} mm seen" if scatter.seen else f"{scatter.unseen:g} mm unseen"


@pytest.mark.parametrize(("scatter", "gauges_mm"), SCATTERS, ids=[named(one) for one, _ in SCATTERS])
def test_a_machine_that_scatters_is_calibrated_and_u_covers(
    figure, scatter: Scatter, gauges_mm: float
) -> None:
    done = on_all_cores(partial(calibrated, scatter, gauges_mm), range(MACHINES))
    every = [one for one, _ in done]
    what = named(scatter)
    for number, one in enumerate(every):
        if one.verdict is None:
            figure(f"  machine {number}: {one.reason}", one.true_mm, "mm")
    known = [one for one in every if one.is_stated]
    ended = sum(one.verdict is not None for one in every)
    figure(f"{what}: end with a result", ended, f"of {MACHINES}", at_least(MACHINES))
    covered, least = sum(one.is_covered for one in known), at_least(least_by_chance(0.93, len(known)))
    figure(f"{what}: true error of a round within U", covered, f"of {len(known)}", least)
    figure(f"{what}: passes", sum(one.is_accepted for one in every), f"of {MACHINES}")
    false = sum(one.is_false_pass for one in known)
    figure(f"{what}: pass though the error of a round is above the limit", false, "", NEVER)
    left, bound = np.array([square for _, squares in done for square in squares]).sum(axis=0)
    of_bound = at_most(1.1 + 2.0 / np.sqrt(18.0 * MACHINES))
    figure("  error of the geometry over its Cramer-Rao bound, rms", np.sqrt(left / bound), "", of_bound)
    for name, values in (
        ("true error", [one.true_mm for one in known]),
        ("U", [one.u_mm for one in known]),
    ):
        figure(f"  {name}, median", np.median(values), "mm")
