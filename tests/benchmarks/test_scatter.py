"""Machines whose joints scatter: all end with a result, U covers one round of visits, none passes falsely.

Robots are drawn within the tolerances of the bundled cell. Their noise is measured first, and the gates are
those of a run. The true error is that of one round of visits to the task poses, whose scatter is drawn.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

from hexacell.campaign.task_accuracy import Task
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.sensitivity import pose_sensitivity
from hexacell.robot.model import Robot, robot_of
from tests.benchmarks.figures import NEVER, at_least, least_by_chance
from tests.benchmarks.machines import bundled, on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.virtual_calibration import Judged, Scatter, judged, robot_that_stands

MACHINES = sample(__name__, "MACHINES")
SIZES_MM = (0.02, 0.05, 0.1)
"""With gauges of 10 mm, and those of 50 mm for what needs them."""


@dataclass(frozen=True)
class InOneRound:
    """The largest position error in one round of visits to the task poses, whose scatter is drawn."""

    scatter: Scatter
    random: np.random.Generator

    def __call__(self, after: Robot, truth: Geometry, found: Identification, task: Task) -> float:
        budget = task.budget(found, after.belief(found), after.effects, {})
        assert budget is not None
        off = found.free - after.mechanism.convention.free_parameters(truth)
        actual = after.commanded(truth).actual_poses(task.poses)
        by_joints = pose_sensitivity(after.mechanism, truth, actual.poses, actual.joints, 3).joints
        size = float(np.hypot(self.scatter.seen, self.scatter.unseen))
        stops = size * self.random.standard_normal((len(by_joints), 6))
        errors = budget.errors_of(off).estimated[:, :3] + np.einsum("nij,nj->ni", by_joints, stops)
        return float(np.linalg.norm(errors, axis=-1).max())


def calibrated(scatter: Scatter, number: int) -> Judged:
    cell, random = bundled(), np.random.default_rng([37, number])
    robot = robot_of(cell)
    truth = robot_that_stands(cell, robot, random)
    one = judged(cell, robot, truth, random, InOneRound(scatter, random), scatter)
    # What it consists of cannot be sent to another process.
    return replace(one, done=None)


@pytest.mark.parametrize("kind", ["seen", "unseen"])
@pytest.mark.parametrize("size_mm", SIZES_MM)
def test_a_machine_that_scatters_is_calibrated_and_u_covers(figure, kind: str, size_mm: float) -> None:
    every = on_all_cores(partial(calibrated, Scatter(**{kind: size_mm})), range(MACHINES))
    what = f"joints scatter by {size_mm:g} mm, {kind} by the encoders"
    for number, one in enumerate(every):
        if one.verdict is None:
            figure(f"  machine {number}: {one.reason}", one.true_mm, "mm")
    known = [one for one in every if np.isfinite(one.true_mm)]
    ended = sum(one.verdict is not None for one in every)
    figure(f"{what}: end with a result", ended, f"of {MACHINES}", at_least(MACHINES))
    covered, least = sum(one.is_covered for one in known), at_least(least_by_chance(0.93, len(known)))
    figure(f"{what}: true error of a round within U", covered, f"of {len(known)}", least)
    figure(f"{what}: passes", sum(one.is_accepted for one in every), f"of {MACHINES}")
    false = sum(one.is_false_pass for one in known)
    figure(f"{what}: pass though the error of a round is above the limit", false, "", NEVER)
    for name, values in (
        ("true error", [one.true_mm for one in known]),
        ("U", [one.u_mm for one in known]),
    ):
        figure(f"  {name}, median", np.median(values), "mm")
