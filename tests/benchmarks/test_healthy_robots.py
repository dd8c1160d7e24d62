"""Healthy robots of the bundled cell: built as the drawing allows, with noise and nothing else wrong.

A robot is healthy if it can stand at all points as its controller sends it there: clear of singularities,
and with its passive joints and legs within their limits. Of those that cannot, before they are calibrated,
the figures are printed beside them. Each is measured as a run measures it, identified, written and
verified; its true error at the task poses is known.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.errors import HexacellError
from hexacell.robot.model import robot_of
from hexacell.verdict.decision import Verdict
from tests.benchmarks.figures import NEVER, Figures, at_least, at_most
from tests.benchmarks.machines import bundled, on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.virtual_calibration import calibrate, robot_that_reaches, stands_at
from tests.benchmarks.worlds.effects import Effect
from tests.benchmarks.worlds.table import least_by_chance, most_by_chance
from tests.benchmarks.worlds.world import World

ROBOTS = sample(__name__, "ROBOTS")
"""A tenth of what the target is for."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a robot.

    ``stands``: whether it can, at all points. ``reason``: where no result was verified, a test of the model
    failed, or the orientation does not pass.
    """

    number: int
    stands: bool = False
    verdict: Verdict | None = None
    is_refused: bool = False
    true_mm: float = np.nan
    value_mm: float = np.nan
    u_mm: float = np.nan
    limit_mm: float = np.nan
    named: int = 0
    reason: str = ""

    @property
    def is_covered(self) -> bool:
        """Whether the true error is within U of the stated one."""
        return abs(self.value_mm - self.true_mm) <= self.u_mm

    @property
    def is_accepted(self) -> bool:
        """Whether the result is, without a person."""
        return self.verdict is Verdict.PASS and not self.is_refused


def outcome(number: int) -> Outcome:
    """Of one robot."""
    cell = bundled()
    robot = robot_of(cell)
    random = np.random.default_rng([11, number])
    truth = robot_that_reaches(cell, robot, random)
    stands = stands_at(robot, truth, cell.settings.identification.points)
    try:
        done = calibrate(cell, robot, truth, random)
    except HexacellError as failed:
        return Outcome(number, stands, reason=str(failed))
    found, after, accuracy = done.found, done.after, done.verification.accuracy
    failures = ", ".join(test.sentence for test in done.verification.tests if not test.passed)
    if accuracy is None:
        return Outcome(number, stands, done.verification.verdict, reason=failures or "no accuracy")
    belief = after.belief(found)
    task = Task.of(cell.settings, after, belief).reachable(belief)
    errors = World(after, truth, Effect(), 0).errors(found.geometry, task.poses, task.workspace)
    turned = accuracy.orientation
    if not failures and turned.verdict is not Verdict.PASS:
        failures = f"orientation {turned.value:.3f} +- {turned.expanded:.3f} deg"
    return Outcome(
        number,
        stands,
        done.verification.verdict,
        bool(robot.tolerance_violations(found.estimate)) or not found.goodness.is_explained,
        errors.largest_mm,
        accuracy.position.value,
        accuracy.position.expanded,
        accuracy.position.limit,
        len(found.left_out),
        failures,
    )


def test_healthy_robots_pass(figure):
    every = on_all_cores(outcome, range(ROBOTS))
    healthy = [one for one in every if one.stands]
    judged = [one for one in every if np.isfinite(one.true_mm)]
    for one in every:
        if not one.is_accepted:
            words = (
                f"  robot {one.number}: {one.verdict}, stands {one.stands}, U {one.u_mm:.3f}; {one.reason}"
            )
            figure(words, one.true_mm, "mm")
    _say_verdicts(figure, "healthy robots", healthy)
    refused = sum(not one.is_accepted for one in healthy)
    most = at_most(most_by_chance(0.01, len(healthy)))
    figure("  healthy, anything but a pass without a person", refused, f"of {len(healthy)}", most)
    _say_verdicts(
        figure, "robots that cannot stand at all points", [one for one in every if not one.stands]
    )
    covered = sum(one.is_covered for one in judged)
    false = sum(one.verdict is Verdict.PASS and one.true_mm > one.limit_mm for one in judged)
    least = at_least(least_by_chance(0.93, len(judged)))
    figure("of both: |stated - true| <= U", covered, f"of {len(judged)}", least)
    figure("  passes though the true error is above the limit", false, "", NEVER)
    figure("  records left out as false", sum(one.named for one in judged))


def _say_verdicts(figure: Figures, who: str, outcomes: list[Outcome]) -> None:
    verdicts = Counter(str(one.verdict) for one in outcomes)
    judged = [one for one in outcomes if np.isfinite(one.true_mm)]
    figure(f"{who}: verdicts", ", ".join(f"{n} {name}" for name, n in verdicts.items()))
    figure(
        f"  {who}: anything but a pass", sum(not one.is_accepted for one in outcomes), f"of {len(outcomes)}"
    )
    figure(
        f"  {who}: true error, median", np.median([one.true_mm for one in judged]) if judged else None, "mm"
    )
    figure(f"  {who}: U, median", np.median([one.u_mm for one in judged]) if judged else None, "mm")
