"""How good the choice of poses is: campaigns against the best continuous design for a robot that is known.

``ROBOTS`` in the environment says how many random robots of the demo's cell; the target is for 100.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from hexacell.design.design_efficiency import Efficiency
from hexacell.services.study.studies import processes, run_study
from hexacell.study.design_trials import DesignOutcome, DesignTrial, run_design_trial
from hexacell.study.tasks import Study
from tests.benchmarks.test_study_speed import every

pytestmark = pytest.mark.benchmark

ROBOTS = int(os.environ.get("ROBOTS", "10"))
LEAST = 0.90


def rated(robots: int) -> dict[str, DesignTrial]:
    trials = [DesignTrial(number, rates=True) for number in range(robots)]
    return {trial.key: trial for trial in trials}


RATED = Study("rated", "robots", rated, run_design_trial, DesignOutcome, every)


def test_the_efficiency_of_adaptive_campaigns(tmp_path, say) -> None:
    outcomes = run_study(RATED, tmp_path, ROBOTS, processes(2), lambda *_: None)
    found = [one.efficiency for one in outcomes if one.efficiency is not None]
    assert len(found) >= 0.95 * ROBOTS
    for name, efficiencies, wanted in (
        ("D", [one.d for one in found], f"{LEAST:g}"),
        ("I", [one.i for one in found if one.i is not None], "-"),
    ):
        certified = np.array([one.certified for one in efficiencies])
        tenth, median = np.quantile(certified, [0.1, 0.5])
        say(f"{name}-efficiency of {len(certified)} robots, certified", f"{median:.3f}", wanted)
        say("  a tenth are below; the least certificate", f"{tenth:.3f}; {_least(efficiencies):.3f}", "-")
        if name == "D":
            assert median >= LEAST


def _least(efficiencies: list[Efficiency]) -> float:
    return min(one.certificate for one in efficiencies)
