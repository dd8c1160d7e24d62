"""Robots built as their drawing allows, and robots that are not: how many are refused."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.diagnostics.tolerance_check import tolerance_violations
from hexacell.identification.problem.prior import Tolerances
from hexacell.identification.solver.result import GeometryEstimate, Termination
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import random_robot
from tests.benchmarks.figures import NEVER, at_least
from tests.benchmarks.machines import bundled
from tests.benchmarks.samples import sample

BUILT = sample(__name__, "BUILT")
ROBOT = robot_of(bundled())
MECHANISM, DRAWING = ROBOT.mechanism, ROBOT.drawing
THREE_MM = Tolerances({"S": 3.0, "B": 3.0, "l": 3.0})


def is_refused(built: Geometry, tolerances: Tolerances) -> bool:
    """Of a geometry that is known exactly."""
    normal = MECHANISM.normalize_frames(built)[0]
    exact = GeometryEstimate(normal, np.zeros((len(built.vector),) * 2), Termination.STEP)
    return bool(tolerance_violations(exact, MECHANISM, DRAWING, tolerances))


@pytest.mark.parametrize("ball_mm", [0.0, 35.0])
def test_healthy_robots_are_not_refused(figure, ball_mm: float) -> None:
    tolerances = replace(THREE_MM, ball_mm=ball_mm)
    drawn = [random_robot(MECHANISM, DRAWING, tolerances, np.random.default_rng(n)) for n in range(BUILT)]
    refused = sum(is_refused(robot, tolerances) for robot in drawn)
    figure(f"healthy robots refused, ball_mm = {ball_mm:g}", refused, f"of {BUILT}", NEVER)


def test_robots_with_one_coordinate_twice_as_far_out_are_refused(figure) -> None:
    refused = 0
    for number in range(BUILT):
        random = np.random.default_rng([1, number])
        built = DRAWING.vector + random.uniform(-3.0, 3.0, len(DRAWING.vector))
        wrong = random.integers(len(built))
        built[wrong] = DRAWING.vector[wrong] + random.choice([-6.0, 6.0])
        refused += is_refused(Geometry(MECHANISM.parameters, built), THREE_MM)
    figure("robots with one coordinate at 6 of 3 mm refused", refused, f"of {BUILT}", at_least(0.9 * BUILT))
