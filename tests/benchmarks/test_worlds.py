"""The statement of accuracy against what imperfect machines really do.

Worlds (``tests/benchmarks/worlds``) are measured at 5 points x 11 orientations within 45 deg, identified,
and stated with the uncertainty budget of their machine; what they really do at the task poses is known.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from hexacell.cell.uncertainty import Grade
from hexacell.identification.estimator import identify
from hexacell.identification.placement import Weight
from hexacell.uncertainty.effect_kinds import own_weight
from tests.benchmarks.figures import NEVER, at_most, between, least_by_chance, most_by_chance
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.worlds import budgets
from tests.benchmarks.worlds.kinds import DOWN, KINDS, NONE, ORDINARY, PRECISION
from tests.benchmarks.worlds.trials import Outcome, Trial, carry_out, settings, world_of

RUNS = sample(__name__, "RUNS")
DRAWN = 30
"""Machines drawn from each budget, for one run of each kind."""

FACTORS = (1.0, 3.0, 10.0)

MACHINES: dict[str, tuple[str, Grade, float]] = {
    "no effects": (NONE, "ideal", 0.38),
    "precision": (PRECISION, "precision", 0.41),
    "ordinary": (ORDINARY, "ordinary", 0.44),
}
"""What is drawn, the grade that is stated, and a limit of 2.4 U, U at the median, which most pass."""


def outcomes(trials: Iterable[Trial]) -> list[Outcome]:
    settings()  # before the processes are forked, so that they share them
    return on_all_cores(carry_out, trials, together=4)


def passes(every: list[Outcome]) -> int:
    return sum(one.is_accepted for one in every)


def false_passes(every: list[Outcome]) -> int:
    return sum(one.is_false_pass for one in every)


def wrongly_named(every: list[Outcome]) -> int:
    return sum(one.is_wrongly_named for one in every)


@pytest.mark.parametrize("name", MACHINES)
def test_machines_drawn_from_their_budget_err_by_no_more_than_is_stated(figure, name):
    kind, grade, limit = MACHINES[name]
    every = outcomes(Trial(kind, 1.0, number, grade, limit) for number in range(DRAWN * RUNS))
    judged = [one for one in every if one.verdict is not None]
    true, of = np.array([one.true_mm for one in judged]), len(judged)
    figure(f"{name}: largest error, median of {of} machines", np.median(true), "mm")
    figure("  95 % within", np.quantile(true, 0.95), "mm")
    stated = [one for one in judged if one.is_stated]
    figure(f"  U, median (limit {limit:g})", np.median([one.u_mm for one in stated]), "mm")
    covers = between(least_by_chance(0.93, len(stated)), most_by_chance(0.98, len(stated)))
    figure("  |stated - true| <= U", sum(one.is_covered for one in stated), f"of {len(stated)}", covers)
    figure("  passes", passes(every), f"of {len(every)}")
    figure("  false ones", false_passes(every), "", NEVER)
    figure("  causes named wrongly", wrongly_named(every), "", at_most(most_by_chance(0.01, len(every))))


def test_no_machine_beyond_the_budget_passes_that_records_show_to_be_wrong(figure):
    """Every kind, in multiples of its usual size, stated with the budget of a precision machine."""
    swept = outcomes(
        Trial(kind, factor, number) for kind in KINDS for factor in FACTORS for number in range(RUNS)
    )
    for factor in FACTORS:
        each = [one for one in swept if one.trial.factor == factor]
        covered = np.mean([one.is_covered for one in each if one.is_stated])
        figure(f"{factor:g} times the usual size: passes", passes(each), f"of {len(each)}")
        figure(f"  {factor:g} times: false ones", false_passes(each))
        figure(f"  {factor:g} times: |stated - true| <= U", 100 * covered, "%")
        figure(f"  {factor:g} times: causes named wrongly", wrongly_named(each))
    shown = [one for one in swept if one.trial.factor > 1.0 and not KINDS[one.trial.kind].hidden]
    of, most = len(shown), at_most(most_by_chance(0.01, len(shown)))
    figure("false passes, effects that records can show", false_passes(shown), f"of {of}", most)
    named = at_most(most_by_chance(0.01, len(swept)))
    figure("causes named wrongly", wrongly_named(swept), f"of {len(swept)}", named)


WEIGHTS, QUIET_MM = 23, 0.003
"""Machines under 100 N, measured with so little noise that the records show how their legs yield."""


def is_doubtful(number: int, um_per_n: float, *, stated: bool) -> bool:
    """Whether residuals of a healthy machine are too large, or records of it are called false."""
    world, own = world_of(Trial("legs elastic, 100 N", um_per_n / 0.03, number, "ideal"))
    noise = replace(own.robot.noise, alignment=0.0, gauge_scale=0.0, encoder=QUIET_MM, gauge_mm=QUIET_MM)
    effects = budgets.machine("ideal")
    if stated:
        effects = (*effects, own_weight(100.0, um_per_n, Weight(own.robot.frames.base @ DOWN)))
    robot = replace(own.robot, noise=noise, effects=effects)
    records = replace(world, robot=replace(world.robot, noise=noise)).records(
        own.commands, robot.commanding
    )
    found = identify(robot.problem(records))
    return bool(found.data_faults) or not found.goodness.is_explained


def test_no_healthy_machine_is_doubtful_whose_weight_is_stated(figure):
    for um_per_n in (0.03, 0.05):
        without, known = (
            sum(is_doubtful(number, um_per_n, stated=stated) for number in range(WEIGHTS))
            for stated in (False, True)
        )
        figure(f"doubtful, 100 N at {um_per_n:g} um/N, not stated", without, f"of {WEIGHTS}")
        figure("  stated", known, f"of {WEIGHTS}", NEVER)
