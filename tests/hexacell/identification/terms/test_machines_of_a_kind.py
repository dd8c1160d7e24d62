"""Protects the rows of docs/not-geometry.md by the benchmark: U covers, and nothing passes falsely."""

from functools import partial

import pytest

from hexacell.verdict.decision import Verdict
from tests.benchmarks.figures import least_by_chance
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.test_terms import MACHINES_OF_A_KIND, carried_out
from tests.benchmarks.worlds.trials import LIMIT_MM

SAMPLE = 10


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["none of them", "play +-0.02 mm", "backlash +-0.1 mm"])
def test_few_machines_of_a_row(kind: str) -> None:
    every = on_all_cores(partial(carried_out, MACHINES_OF_A_KIND[kind]), range(SAMPLE))
    covered = sum(abs(one.value_mm - one.true_mm) <= one.u_mm for one in every)
    assert covered >= least_by_chance(0.93, SAMPLE)
    assert all(one.true_mm <= LIMIT_MM for one in every if one.verdict is Verdict.PASS)
    assert sum(bool(one.taken) for one in every) in ((0, 1) if kind == "none of them" else (SAMPLE,))
