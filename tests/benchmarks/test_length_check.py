"""The length check on machines that have all effects of their grade, and encoders that are wrong alike.

Each cause is drawn; machines are moved, measured and commanded without any propagation to first order. What
is stated after the check, the largest error over the task poses with U, must hold their true one. U of the
scale must hold the true scale.
"""

from __future__ import annotations

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import RecordPlacement
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.stated import stated_effects
from hexacell.uncertainty.length_check import LengthCheck
from hexacell.uncertainty.length_records import JudgedGeometry, LengthRecords, LengthStandard
from tests.benchmarks.figures import at_least
from tests.benchmarks.samples import sample
from tests.benchmarks.worlds.budgets import drawn, machine, settings_of
from tests.benchmarks.worlds.campaigns import setting
from tests.benchmarks.worlds.effects import at_once
from tests.benchmarks.worlds.encoders import scale
from tests.benchmarks.worlds.world import World

MACHINES = sample(__name__, "MACHINES")
COMMON_UM_M = 300.0
"""One standard deviation of the scale that all encoders have alike: ten to twenty times that of a grade."""

SEATING_MM, CERTIFICATE_MM, DISTANCE_MM = 0.003, 0.001, 300.0
SEATS = {
    "along the rails": ((-150.0, 0.0, 500.0), (1.0, 0.0, 0.0)),
    "across": ((0.0, -150.0, 500.0), (0.0, 1.0, 0.0)),
}
POSES = ((0.0, 0.0), (10.0, 0.0), (-10.0, 0.0), (0.0, 10.0), (0.0, -10.0))


def two_seats(world: World, found: Identification, name: str, random: np.random.Generator) -> LengthRecords:
    """The records of three mountings of a machine that is commanded with what was found of it."""
    start, direction = (np.array(one) for one in SEATS[name])
    rows = [(number, tilt) for number in (1, 2, 3) for tilt in POSES]
    mountings = np.array([number for number, _ in rows])
    offsets = np.where((mountings % 2 == 0)[:, None], DISTANCE_MM * direction, 0.0)
    commands = PoseBatch.of(
        _pose(start + offset, *tilt) for offset, (_, tilt) in zip(offsets, rows, strict=True)
    )
    robot, noise = world.robot, world.robot.noise
    shown, balls = world.touched(commands, found.geometry)
    seated = SEATING_MM * random.standard_normal((3, 3))[mountings - 1]
    true = DISTANCE_MM + CERTIFICATE_MM * random.standard_normal()
    seats = balls[0] + offsets * true / DISTANCE_MM + seated
    deviations: Array = balls - seats + noise.gauge_mm * random.standard_normal(balls.shape)
    read = shown + noise.encoder * random.standard_normal(shown.shape)
    commanded = RecordPlacement(robot.mechanism, found.geometry, commands, read, deviations, np.eye(3))
    return LengthRecords.of(commanded, mountings)


def _pose(position: Array, a: float, b: float) -> Pose:
    x, y, z = position.tolist()
    return Pose(x, y, z, a, b)


@pytest.mark.parametrize("grade", ["precision", "ordinary"])
@pytest.mark.parametrize("name", SEATS)
def test_what_is_stated_after_a_length_check_holds(grade, name, figure) -> None:
    own = setting(0)
    robot, task = own.robot, own.task
    stated = settings_of(grade)
    sizes = stated.uncertainty.model_copy(update={"common_encoder_scale_um_m": COMMON_UM_M})
    effects = stated_effects(stated.model_copy(update={"uncertainty": sizes}))
    others = [effect for effect in machine(grade) if effect.name != "scale common to all encoders"]
    standard = LengthStandard(DISTANCE_MM, CERTIFICATE_MM, seating_mm=SEATING_MM)
    random = np.random.default_rng(21)
    scale_held, held, agreed, expanded = 0, 0, 0, []
    for number in range(MACHINES):
        common = COMMON_UM_M * float(random.standard_normal())
        effect = at_once(drawn(others, 1.0, random), scale(1e-6 * common * np.ones(6)))
        world = World(robot, own.truth, effect, number)
        found = identify(robot.problem(world.records(own.commands, robot.commanding)), find_outliers=False)
        belief = robot.belief(found)
        budget = task.budget(found, belief, effects)
        assert budget is not None
        covariance = found.free_covariance * found.goodness.noise_factor**2
        judged = JudgedGeometry(covariance, budget.parameter_columns)
        check = LengthCheck.of(
            two_seats(world, found, name, random), standard, robot.noise, judged, effects
        )
        after = task.budget(found, belief, effects, scale=check.observation)
        assert after is not None
        stated_error = after.errors_of(np.zeros(len(found.free))).position
        reached = task.reachable(belief)
        true = world.errors(found.geometry, reached.poses, reached.workspace).largest_once_mm
        scale_held += abs(check.encoders_long_um_m - common) <= check.expanded_um_m
        held += abs(stated_error.value - true) <= stated_error.expanded
        agreed += check.agreement.probability >= 1e-3
        expanded.append((check.expanded_um_m, budget.expanded_mm, stated_error.expanded))
    scale_um_m, before, left = np.mean(expanded, axis=0)
    words = f"true scale within U ({scale_um_m:.0f} um/m), {name}, {grade}"
    figure(words, scale_held / MACHINES, "", at_least(0.85))
    figure("  the largest error within U of what is stated", held / MACHINES, "", at_least(0.9))
    figure("  U of that without the check", before, "mm")
    figure("  U of that with it", left, "mm")
    figure("  checks whose records agree", agreed / MACHINES, "", at_least(0.97))
