"""Mistakes in the records of good and of imperfect machines: are they named?

And where the machine itself is at fault, and nothing may be named: what is listed first?
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.solver.chi_square import ChiSquareVerdict
from hexacell.identification.solver.result import DataFault, GaugeFaultError
from hexacell.measurements.records import MeasurementSet
from hexacell.uncertainty.possible_causes import possible_causes
from tests.benchmarks.figures import at_least
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.worlds.campaigns import Setting
from tests.benchmarks.worlds.kinds import NONE, ORDINARY, PRECISION
from tests.benchmarks.worlds.mistakes import MISTAKES
from tests.benchmarks.worlds.table import least_by_chance
from tests.benchmarks.worlds.trials import Trial, settings, world_of

RUNS = sample(__name__, "RUNS")
MACHINES = 6
"""Of each kind, for one run."""

NAMED_SHARES = {NONE: 0.98, PRECISION: 0.97, ORDINARY: 0.92}
"""What a machine's own errors hide beside its records is left."""

FIRST_LISTED = {
    "encoders, scale bent": ("errors of the encoders", 30.0),
    "encoders, each its scale": ("errors of the encoders", 30.0),
    "rails wavy z, 600 mm": ("guides", 10.0),
    "three rails pitch, each": ("guides", 20.0),
    "rails yaw and pitch, each": ("guides", 20.0),
    "legs elastic, 20 N": ("legs that yield", 10.0),
    "heavy tool": ("legs that yield", 3.0),
    "legs creep, each": ("a temperature", 10.0),
    "gauges, each its scale": ("the gauges", 20.0),
    "triad turned, at each point": ("the gauges", 10.0),
    "poor gauges": ("the gauges", 5.0),
}
"""How what is listed first begins, and so many times the usual size, at which residuals tell of it."""

FIRST_SHARE = 0.9


def named(own: Setting, measured: MeasurementSet) -> tuple[DataFault, ...]:
    try:
        return identify(own.robot.problem(measured)).data_faults
    except GaugeFaultError as refused:
        return (refused.fault,)


def is_named(kind: str, job: tuple[int, int]) -> bool:
    """One of the mistakes, by its place among them, in the records of a machine."""
    mistake, number = MISTAKES[job[0]], job[1]
    world, own = world_of(Trial(kind, 1.0, number))
    measured = world.records(own.commands, own.robot.commanding)
    random = np.random.default_rng([29, number, *mistake.name.encode()])
    wrong, concerned = mistake.make(measured, random)
    return mistake.is_named_by(named(own, wrong), concerned)


@pytest.mark.parametrize(("kind", "least"), NAMED_SHARES.items())
def test_mistakes_are_named(figure, kind, least):
    settings()  # before the processes are forked, so that they share them
    count = MACHINES * RUNS
    jobs = [(place, number) for place in range(len(MISTAKES)) for number in range(count)]
    every = on_all_cores(partial(is_named, kind), jobs, together=count)
    for place, mistake in enumerate(MISTAKES):
        results = every[place * count : (place + 1) * count]
        figure(f"{mistake.name}, {kind}: named", sum(results), f"of {len(results)}")
    target = at_least(least_by_chance(least, len(every)))
    figure(f"all mistakes, {kind}: named", sum(every), f"of {len(every)}", target)


def listed_first(kind: str, factor: float) -> list[str]:
    """What explains most of the residuals of some machines in which these are too large."""
    names = []
    for number in range(MACHINES * RUNS):
        world, own = world_of(Trial(kind, factor, number))
        found = identify(own.robot.problem(world.records(own.commands, own.robot.commanding)))
        if found.goodness.agreement is ChiSquareVerdict.TOO_LARGE:
            names += [cause.name for cause in possible_causes(found)[:1]]
    return names


def test_what_is_wrong_with_a_machine_explains_most(figure):
    right = every = 0
    for kind, (name, factor) in FIRST_LISTED.items():
        first = listed_first(kind, factor)
        hits = sum(one.startswith(name) for one in first)
        right, every = right + hits, every + len(first)
        figure(f"{factor:g} times {kind}: {name} ... is listed first", hits, f"of {len(first)}")
    target = at_least(least_by_chance(FIRST_SHARE, every))
    figure("the right cause is listed first", right, f"of {every}", target)
    assert every > 3 * len(FIRST_LISTED) * RUNS
