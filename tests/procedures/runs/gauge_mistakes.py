"""Mistakes with the gauges of a rig: exchanged, turned round, in inches, dead."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from hexacell.cell.bundled import bundled_config
from hexacell.cell.fields import GeometrySettings
from hexacell.cell.loader import load_cell
from hexacell.cell.model import CellSettings
from hexacell.kinematics.pose import Pose
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import VirtualRobot, random_robot

MM_PER_INCH = 25.4

PAIRS = (("x", "y"), ("x", "z"), ("y", "z"))

MISTAKES = {
    **{f"{a} and {b} exchanged": f"gauges {a}, {b}: are exchanged" for a, b in PAIRS},
    **{f"{axis} reversed": f"gauge {axis}: counts the wrong way" for axis in "xyz"},
    **{f"{axis} in inches": f"gauge {axis}: seems to answer in inches" for axis in "xyz"},
    **{f"{axis} dead": f"gauge {axis}: does not follow the ball" for axis in "xyz"},
}
"""Each mistake, and what a run says of it."""


def make_mistake(rig: Any, mistake: str) -> None:
    """Make it now; the gauges of the rig are right until then."""
    gauges = {gauge.name: gauge for gauge in rig.gauges}
    right = {gauge.name: gauge.shown for gauge in rig.gauges}
    rig.right_gauges = right
    if exchanged := re.fullmatch("(.) and (.) exchanged", mistake):
        one, other = exchanged.groups()
        gauges[one].shown, gauges[other].shown = right[other], right[one]
        return
    name, _, what = mistake.partition(" ")
    shown, stuck_mm = right[name], right[name]()
    gauges[name].shown = {
        "reversed": lambda: -shown(),
        "in inches": lambda: shown() / MM_PER_INCH,
        "dead": lambda: stuck_mm,
    }[what]


def drawn_robots(settings: CellSettings, seed: int) -> Iterator[GeometrySettings]:
    """Robots built within the tolerances that reach the points at which they are measured."""
    cell, simulation = load_cell(bundled_config("simulated-hexaglide")), settings.simulation
    assert simulation is not None
    robot, random = robot_of(cell), np.random.default_rng(seed)
    points = (*settings.identification.points, *settings.verification.points)
    references = robot.from_commands([Pose(*point) for point in points])
    while True:
        truth = random_robot(robot.mechanism, robot.drawing, robot.tolerances, random)
        if VirtualRobot(robot, truth).can_take(references).all():
            yield type(simulation.geometry).model_validate(truth.document())


def corrected(rig: Any) -> None:
    """Put the gauges right again."""
    for gauge in rig.gauges:
        gauge.shown = rig.right_gauges[gauge.name]
