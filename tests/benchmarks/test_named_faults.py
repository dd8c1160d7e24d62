"""Mistakes in the records of good and of imperfect machines: are they named?

``RUNS`` in the environment says how many machines there are of each kind.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import DataFault, GaugeFaultError
from hexacell.measurements.records import MeasurementSet
from tests.benchmarks.worlds.campaigns import Setting
from tests.benchmarks.worlds.kinds import NONE, ORDINARY, PRECISION
from tests.benchmarks.worlds.mistakes import MISTAKES, Mistake
from tests.benchmarks.worlds.table import least_by_chance
from tests.benchmarks.worlds.trials import Trial, world_of

RUNS = int(os.environ.get("RUNS", "1"))
MACHINES = 6
"""Of each kind, for one run."""

NAMED_SHARES = {NONE: 0.98, PRECISION: 0.97, ORDINARY: 0.92}
"""What a machine's own errors hide beside its records is left."""


def named(own: Setting, measured: MeasurementSet) -> tuple[DataFault, ...]:
    try:
        return identify(own.robot.problem(measured)).data_faults
    except GaugeFaultError as refused:
        return (refused.fault,)


def are_named(mistake: Mistake, kind: str) -> list[bool]:
    """Of some machines."""
    results = []
    for number in range(MACHINES * RUNS):
        world, own = world_of(Trial(kind, 1.0, number))
        measured = world.records(own.commands, own.robot.commanding)
        random = np.random.default_rng([29, number, *mistake.name.encode()])
        wrong, concerned = mistake.make(measured, random)
        results.append(mistake.is_named_by(named(own, wrong), concerned))
    return results


@pytest.mark.parametrize(("kind", "least"), NAMED_SHARES.items())
def test_mistakes_are_named(say, kind, least):
    every: list[bool] = []
    for mistake in MISTAKES:
        results = are_named(mistake, kind)
        every += results
        say(f"{mistake.name}, {kind}", f"{sum(results)} of {len(results)}", "named")
    share = 100 * sum(every) / len(every)
    say(f"all mistakes, {kind}", f"{share:.1f} %", f"at least {100 * least:.0f} %")
    assert sum(every) >= least_by_chance(least, len(every))
