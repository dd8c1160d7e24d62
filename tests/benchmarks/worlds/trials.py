"""One world measured, identified, stated and compared with what it really does."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cache

import numpy as np

from hexacell.cell.uncertainty import Grade
from hexacell.decision import Verdict
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import GaugeFaultError, Identification
from tests.benchmarks.worlds import budgets
from tests.benchmarks.worlds.campaigns import Setting, UnreachableError, setting
from tests.benchmarks.worlds.closure import CannotCloseError
from tests.benchmarks.worlds.kinds import KINDS
from tests.benchmarks.worlds.stating import LIMIT_MM, stated
from tests.benchmarks.worlds.world import World

ROBOTS = 6


@dataclass(frozen=True, slots=True)
class Trial:
    """Which world: a kind, a multiple of its usual size, and a number.

    Attributes:
        grade: of the machine whose budget is stated.
    """

    kind: str
    factor: float
    number: int
    grade: Grade = "precision"
    limit_mm: float = LIMIT_MM


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a trial.

    Attributes:
        verdict: none if there is no geometry that could be judged, for some ``reason``.
        true_mm: the largest expected error at a task pose of the identified geometry.
        once_mm: the largest error of one visit of each.
        value_mm: what is stated of it, and its ``u_mm``.
        sigma_mm: of that by the noise of the records, one sigma.
        ratio: residuals over the stated noise.
        named: what data faults were said to be in the records.
        is_wrongly_named: whether one of them is not in this world.
    """

    trial: Trial
    verdict: Verdict | None = None
    true_mm: float = np.nan
    once_mm: float = np.nan
    value_mm: float = np.nan
    u_mm: float = np.nan
    sigma_mm: float = np.nan
    ratio: float = np.nan
    named: tuple[str, ...] = ()
    is_wrongly_named: bool = False
    reason: str = ""

    @property
    def is_covered(self) -> bool:
        """Whether the error of a visit is within U of the stated one."""
        return abs(self.value_mm - self.once_mm) <= self.u_mm

    @property
    def is_false_pass(self) -> bool:
        """Whether the verdict is a pass although the expected error is above the limit."""
        return self.verdict is Verdict.PASS and self.true_mm > self.trial.limit_mm


def carry_out(trial: Trial) -> Outcome:
    """Measure, identify, state and compare."""
    world, own = world_of(trial)
    try:
        found = identify(own.robot.problem(world.records(own.commands, own.robot.commanding)))
        return _judged(trial, world, found)
    except GaugeFaultError as refused:
        wrong = refused.fault.kind not in KINDS[trial.kind].faults
        return Outcome(trial, named=(str(refused.fault.kind),), is_wrongly_named=wrong, reason=str(refused))
    except (HexacellError, CannotCloseError) as failed:
        return Outcome(trial, reason=str(failed))


def world_of(trial: Trial) -> tuple[World, Setting]:
    """The world of a trial, the same for all multiples of its size, and what is measured there."""
    random = np.random.default_rng([23, trial.number, *trial.kind.encode()])
    own = settings()[trial.number % ROBOTS]
    seed = int(random.integers(1 << 31))
    return World(own.robot, own.truth, KINDS[trial.kind].world(trial.factor, random), seed), own


@cache
def settings() -> tuple[Setting, ...]:
    """Of the first robots that can take the poses of a campaign."""
    found: list[Setting] = []
    number = 0
    while len(found) < ROBOTS:
        with suppress(UnreachableError):
            found.append(setting(number))
        number += 1
    return tuple(found)


def _judged(trial: Trial, world: World, found: Identification) -> Outcome:
    own = settings()[trial.number % ROBOTS]
    says = stated(own.cell.settings, own.robot, found, budgets.machine(trial.grade))
    hour = world.hours(own.commands, own.robot.commanding)
    errors = world.errors(found.geometry, says.poses, says.workspace, hour)
    faults = KINDS[trial.kind].faults
    return Outcome(
        trial=trial,
        verdict=says.verdict(trial.limit_mm),
        true_mm=errors.largest_mm,
        once_mm=errors.largest_once_mm,
        value_mm=says.error.value,
        u_mm=says.error.expanded,
        sigma_mm=says.sigma_mm,
        ratio=found.goodness.ratio,
        named=tuple(str(fault.kind) for fault in found.data_faults),
        is_wrongly_named=any(fault.kind not in faults for fault in found.data_faults),
    )
