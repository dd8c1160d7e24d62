"""Published robots: others of the same drawing, each calibrated and judged with all gates of a run.

They are precise or small, and the tolerances alone determine many of their parameters; what counts is the
error at their task poses.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.robot.model import robot_of
from tests.benchmarks.figures import NEVER, at_least, least_by_chance
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.virtual_calibration import Judged, by_derivatives, judged, robot_that_stands
from tests.public_geometries.test_whole_job import CELLS

ROBOTS = sample(__name__, "ROBOTS")
PATHS = {path.stem: path for path in CELLS}


def outcome(name: str, number: int) -> Judged:
    cell, random = load_cell(PATHS[name]), np.random.default_rng([19, number])
    robot = robot_of(cell)
    one = judged(cell, robot, robot_that_stands(cell, robot, random), random, by_derivatives)
    # What it consists of cannot be sent to another process.
    return replace(one, done=None)


def waits(one: Judged) -> str:
    """What keeps a geometry from being written without a person; empty where nothing does."""
    return " ".join(one.unmet) if one.verdict is not None else one.reason


@pytest.mark.parametrize("name", PATHS)
def test_others_of_the_same_drawing_are_written_and_none_is_wrong(figure, name: str) -> None:
    every = on_all_cores(partial(outcome, name), range(ROBOTS))
    for number, one in enumerate(every):
        if not one.is_accepted:
            figure(f"  robot {number}: U {one.u_mm:.4f} mm; {one.reason} {waits(one)}", one.true_mm, "mm")
    known = [one for one in every if one.is_stated]
    stopped = sum(bool(waits(one)) and not one.u_mm > one.limit_mm for one in every)
    figure(f"{name}: refused or waiting though U is within the limit", stopped, f"of {ROBOTS}", NEVER)
    figure(f"{name}: pass without a person", sum(one.is_accepted for one in every), f"of {ROBOTS}")
    false = sum(one.is_false_pass for one in known)
    figure(f"{name}: passes though the true error is above the limit", false, "", NEVER)
    covered, least = sum(one.is_covered for one in known), at_least(least_by_chance(0.93, len(known)))
    figure(f"{name}: true error within U", covered, f"of {len(known)}", least)
    figure(f"{name}: U over the limit, median", np.median([one.u_mm / one.limit_mm for one in known]))
    figure(f"{name}: true error, median", 1e3 * np.median([one.true_mm for one in known]), "um")
