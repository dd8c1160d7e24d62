"""Published robots: others of the same drawing, each calibrated and judged with all gates of a run.

They are precise or small, and the tolerances alone determine many of their parameters; what counts is the
error at their task poses.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.robot.model import robot_of
from hexacell.verdict.acceptance_gates import gates
from hexacell.verdict.decision import Verdict
from tests.benchmarks.figures import NEVER, at_least, least_by_chance
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.virtual_calibration import Judged, by_derivatives, judged, robot_that_stands
from tests.public_geometries.test_whole_job import CELLS

ROBOTS = sample(__name__, "ROBOTS")
PATHS = {path.stem: path for path in CELLS}


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a robot; ``waits``: what keeps its geometry from being written without a person."""

    judged: Judged
    waits: tuple[str, ...] = ()

    @property
    def is_stopped_within(self) -> bool:
        """Whether a run would end without its geometry, though U at the task is within the limit."""
        return bool(self.waits) and not self.judged.u_mm > self.judged.limit_mm


def outcome(name: str, number: int) -> Outcome:
    cell, random = load_cell(PATHS[name]), np.random.default_rng([19, number])
    robot = robot_of(cell)
    one = judged(cell, robot, robot_that_stands(cell, robot, random), random, by_derivatives)
    if one.done is None:
        return Outcome(one, (one.reason,))
    found = one.done.found
    conditions = gates(
        found.estimate,
        robot.tolerance_violations(found.estimate),
        residuals=found.goodness,
        change_mm=robot.largest_change(found.geometry),
        largest_change_mm=cell.settings.acceptance.largest_change_mm,
    )
    # What it consists of cannot be sent to another process.
    return Outcome(replace(one, done=None), tuple(gate.sentence for gate in conditions if not gate.passed))


@pytest.mark.parametrize("name", PATHS)
def test_others_of_the_same_drawing_are_written_and_none_is_wrong(figure, name: str) -> None:
    every = on_all_cores(partial(outcome, name), range(ROBOTS))
    for number, one in enumerate(every):
        of = one.judged
        if one.waits or of.verdict is not Verdict.PASS:
            figure(
                f"  robot {number}: U {of.u_mm:.4f} mm; {of.reason} {' '.join(one.waits)}", of.true_mm, "mm"
            )
    known = [one.judged for one in every if np.isfinite(one.judged.true_mm)]
    stopped = sum(one.is_stopped_within for one in every)
    figure(f"{name}: refused or waiting though U is within the limit", stopped, f"of {ROBOTS}", NEVER)
    passes = sum(one.judged.verdict is Verdict.PASS and not one.waits for one in every)
    figure(f"{name}: pass without a person", passes, f"of {ROBOTS}")
    false = sum(one.is_false_pass for one in known)
    figure(f"{name}: passes though the true error is above the limit", false, "", NEVER)
    covered, least = sum(one.is_covered for one in known), at_least(least_by_chance(0.93, len(known)))
    figure(f"{name}: true error within U", covered, f"of {len(known)}", least)
    figure(f"{name}: U over the limit, median", np.median([one.u_mm / one.limit_mm for one in known]))
    figure(f"{name}: true error, median", 1e3 * np.median([one.true_mm for one in known]), "um")
