"""The statement of accuracy against what imperfect machines really do.

Worlds (``tests/benchmarks/worlds``) are measured at 5 points x 11 orientations within 45 deg, identified,
and stated with the uncertainty budget of their machine; what they really do at the task poses is known.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.uncertainty import Grade
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.propagation import Propagation
from tests.benchmarks.figures import NEVER, at_most, between
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.worlds.budgets import drawn, machine
from tests.benchmarks.worlds.campaigns import Setting
from tests.benchmarks.worlds.effects import Effect
from tests.benchmarks.worlds.kinds import KINDS, NONE, ORDINARY, PRECISION
from tests.benchmarks.worlds.table import Totals, least_by_chance, most_by_chance
from tests.benchmarks.worlds.trials import Outcome, Trial, carry_out, settings
from tests.benchmarks.worlds.world import World

RUNS = sample(__name__, "RUNS")
DRAWN = 30
"""Machines drawn from each budget, for one run of each kind."""

FACTORS = (1.0, 3.0, 10.0)
UNSUSPICIOUS = 1.2
"""Residuals over the noise; three standard deviations above one for a campaign."""

ALIKE = 40
"""Machines with one effect, for one run of each kind."""

HOUR = 1.0
"""At which a machine is at work, long after nothing drifts any more."""

ONE_BY_ONE = [effect for effect in machine("ordinary") if effect.size and not effect.is_estimated]

MACHINES: dict[str, tuple[str, Grade, float]] = {
    "no effects": (NONE, "ideal", 0.38),
    "precision": (PRECISION, "precision", 0.41),
    "ordinary": (ORDINARY, "ordinary", 0.44),
}
"""What is drawn, the grade that is stated, and a limit of 2.4 U, U at the median, which most pass."""


def identified(own: Setting, effect: Effect, seed: int) -> tuple[World, Identification]:
    """A machine without noise, and what its records give."""
    world = World(own.robot, own.truth, effect, seed, is_noisy=False)
    records = world.records(own.commands, own.robot.commanding)
    return world, identify(own.robot.problem(records), find_outliers=False)


def outcomes(trials: Iterable[Trial]) -> list[Outcome]:
    settings()  # before the processes are forked, so that they share them
    return on_all_cores(carry_out, trials, together=4)


@pytest.mark.parametrize("name", MACHINES)
def test_machines_drawn_from_their_budget_err_by_no_more_than_is_stated(figure, name):
    kind, grade, limit = MACHINES[name]
    totals = Totals(outcomes(Trial(kind, 1.0, number, grade, limit) for number in range(DRAWN * RUNS)))
    judged = totals.judged
    true = np.array([one.true_mm for one in judged])
    u = np.median([one.u_mm for one in judged])
    figure(f"{name}: largest error, median of {len(judged)} machines", np.median(true), "mm")
    figure("  95 % within", np.quantile(true, 0.95), "mm")
    figure(f"  U, median (limit {limit:g})", u, "mm")
    covers = between(least_by_chance(0.93, len(judged)), most_by_chance(0.98, len(judged)))
    figure("  |stated - true| <= U", round(totals.covered * len(judged)), f"of {len(judged)}", covers)
    figure("  passes", totals.passes, f"of {len(totals.outcomes)}")
    figure("  false ones", totals.false_passes, "", NEVER)
    figure("  false ones with a guard band of U alone", totals.false_passes_with_u)
    named = at_most(most_by_chance(0.01, len(totals.outcomes)))
    figure("  causes named wrongly", totals.wrongly_named, "", named)


@pytest.mark.parametrize("effect", ONE_BY_ONE, ids=lambda effect: effect.name)
def test_a_line_of_the_budget_is_the_error_that_machines_with_that_effect_make(figure, effect):
    own = settings()[0]
    _, found = identified(own, Effect(), 0)
    belief = own.robot.belief(found)
    reached = Task.of(own.cell.settings, own.robot, belief).reachable(belief)
    propagation = Propagation.of(found, belief, task=reached.poses, workspace=reached.workspace)
    line = UncertaintyBudget.of(propagation, [effect]).lines[0]
    random = np.random.default_rng(11)
    squares = []
    for _ in range(ALIKE * RUNS):
        world, found = identified(own, drawn([effect], 1.0, random), int(random.integers(1 << 31)))
        errors = world.errors(found.geometry, reached.poses, reached.workspace, HOUR)
        squares.append(np.sum(errors.once**2, axis=-1))
    simulated = float(np.sqrt(np.mean(squares, axis=0).max()))
    ratio = simulated / line.combined_mm
    slack = 0.1 + 3.5 / np.sqrt(2 * ALIKE * RUNS)
    words = f"{effect.name}, {effect.size:g} {effect.unit}"
    figure(words, simulated, "mm")
    figure(f"{words}: over the budget's", ratio, "", between(1.0 - slack, 1.0 + slack))


@pytest.fixture(scope="module")
def swept() -> list[Outcome]:
    """Every kind, in multiples of its usual size, stated with the budget of a precision machine."""
    return outcomes(
        Trial(kind, factor, number) for kind in KINDS for factor in FACTORS for number in range(RUNS)
    )


def test_no_machine_beyond_the_budget_passes_that_records_show_to_be_wrong(swept, figure):
    for factor in FACTORS:
        each = Totals([one for one in swept if one.trial.factor == factor])
        figure(f"{factor:g} times the usual size: passes", each.passes, f"of {len(each.outcomes)}")
        figure(f"  {factor:g} times: false ones", each.false_passes)
        figure(f"  {factor:g} times: |stated - true| <= U", 100 * each.covered, "%")
        figure(f"  {factor:g} times: causes named wrongly", each.wrongly_named)
    shown = Totals([one for one in swept if one.trial.factor > 1.0 and not KINDS[one.trial.kind].hidden])
    of, false = len(shown.outcomes), shown.false_passes
    words = "false passes, effects that records can show"
    figure(words, false, f"of {of}", at_most(most_by_chance(0.01, of)))
    named = at_most(most_by_chance(0.01, len(swept)))
    figure("causes named wrongly", Totals(swept).wrongly_named, f"of {len(swept)}", named)
    assert len({one.trial.kind for one in swept}) >= 60


def test_effects_that_no_record_shows_are_known(swept, figure):
    """They change the error and not the evidence; a statement can only list them."""
    for name, kind in KINDS.items():
        if kind.hidden:
            largest = [
                one
                for one in swept
                if one.trial.kind == name and one.trial.factor == FACTORS[-1] and one.verdict is not None
            ]
            true = np.median([one.true_mm for one in largest])
            ratio = np.median([one.ratio for one in largest])
            words = f"{name}, {FACTORS[-1] * kind.usual:g} {kind.unit}"
            figure(words, true, "mm")
            figure(f"{words}: residuals over the noise", ratio, "", at_most(UNSUSPICIOUS))
