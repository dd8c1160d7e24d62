"""How long a study of many robots takes, each calibrated with orientations that hexacell chooses."""

import os
import time
from collections.abc import Mapping

import pytest

from hexacell.study.design_study import DesignOutcome, DesignTrial, run_design_trial
from hexacell.study.tasks import Study, processes, run_study
from tests.benchmarks.figures import at_most, most_by_chance
from tests.benchmarks.machines import at_most_here
from tests.benchmarks.samples import sample

ROBOTS = sample(__name__, "ROBOTS")
FULL = 1000
LONGEST_S = 600.0
"""The target, which is missed without compiled loops."""
PROCESSES = 2


def tasks_of(robots: int) -> list[DesignTrial]:
    return [DesignTrial(number) for number in range(robots)]


def every(outcomes: Mapping[DesignTrial, DesignOutcome]) -> list[DesignOutcome]:
    return list(outcomes.values())


ADAPTIVE = Study("adaptive", "robots", tasks_of, run_design_trial, DesignOutcome, every)


@pytest.mark.skipif((os.cpu_count() or 1) < PROCESSES, reason="needs two processors")
def test_a_thousand_robots_in_ten_minutes(tmp_path, figure) -> None:
    begun = time.perf_counter()
    outcomes = run_study(ADAPTIVE, tmp_path, ROBOTS, processes(PROCESSES), lambda *_: None)
    seconds = time.perf_counter() - begun
    assert len(outcomes) == ROBOTS
    unidentified = sum(one.last is None for one in outcomes)
    figure(f"{ROBOTS} robots", seconds, "s")
    # Some stand at one point only without leaving their cones.
    figure("  not calibrated", unidentified, "", at_most(most_by_chance(0.01, ROBOTS)))
    whole = seconds * FULL / ROBOTS
    figure(f"{FULL} robots on {PROCESSES} processors", whole, "s", at_most_here(LONGEST_S))
