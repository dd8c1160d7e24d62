"""Healthy robots of the bundled cell: built as the drawing allows, with noise and nothing else wrong.

A robot is healthy if it can stand at all points as its controller sends it there: clear of singularities,
and with its passive joints and legs within their limits. Of those that cannot, before they are calibrated,
the figures are printed beside them. Each is measured as a run measures it, identified, written and
verified; its true error at the task poses is known.
"""

from dataclasses import dataclass, replace

import numpy as np

from hexacell.robot.model import robot_of
from tests.benchmarks.figures import NEVER, at_least, at_most, least_by_chance, most_by_chance
from tests.benchmarks.machines import bundled, on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.virtual_calibration import (
    Judged,
    by_leg_equations,
    judged,
    robot_that_reaches,
    stands_at,
)

ROBOTS = sample(__name__, "ROBOTS")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a robot, and whether it can stand at all points."""

    number: int
    stands: bool
    judged: Judged


def outcome(number: int) -> Outcome:
    cell = bundled()
    robot = robot_of(cell)
    random = np.random.default_rng([11, number])
    truth = robot_that_reaches(cell, robot, random)
    stands = stands_at(robot, truth, cell.settings.identification.points)
    one = judged(cell, robot, truth, random, by_leg_equations)
    # What it consists of cannot be sent to another process.
    return Outcome(number, stands, replace(one, done=None))


def test_healthy_robots_pass(figure):
    every = on_all_cores(outcome, range(ROBOTS))
    for one in every:
        if not one.judged.is_accepted:
            of = one.judged
            why = " ".join((of.reason, *of.unmet))
            words = f"  robot {one.number}: {of.verdict}, stands {one.stands}, U {of.u_mm:.3f}; {why}"
            figure(words, of.true_mm, "mm")
    for who, some in (
        ("healthy robots", [one for one in every if one.stands]),
        ("robots that cannot stand at all points", [one for one in every if not one.stands]),
    ):
        refused = sum(not one.judged.is_accepted for one in some)
        target = at_most(most_by_chance(0.01, len(some))) if who == "healthy robots" else None
        figure(f"{who}: anything but a pass without a person", refused, f"of {len(some)}", target)
    known = [one.judged for one in every if one.judged.is_stated]
    covered, least = sum(one.is_covered for one in known), at_least(least_by_chance(0.93, len(known)))
    figure("of both: |stated - true| <= U", covered, f"of {len(known)}", least)
    figure("  true error, median", np.median([one.true_mm for one in known]), "mm")
    figure("  U, median", np.median([one.u_mm for one in known]), "mm")
    false = sum(one.is_false_pass for one in known)
    figure("  passes though the true error is above the limit", false, "", NEVER)
