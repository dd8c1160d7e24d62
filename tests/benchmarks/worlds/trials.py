"""One world measured, identified, stated and compared with what it really does."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.cell.uncertainty import Grade
from hexacell.errors import HexacellError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import GaugeFaultError, Identification
from hexacell.measurements.records import MeasurementSet
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import HeldOut, Verification, verify
from tests.benchmarks.worlds import budgets
from tests.benchmarks.worlds.campaigns import Setting, UnreachableError, setting
from tests.benchmarks.worlds.closure import CannotCloseError
from tests.benchmarks.worlds.kinds import KINDS
from tests.benchmarks.worlds.world import Commands, World

ROBOTS = 6
LIMIT_MM = 0.33
"""On the largest error at a task pose: one that most machines without mistakes pass."""

HELD_OUT_FROM, CONFIRMING_FROM = 100, 200
"""Points of the held-out and confirming records, which are of no other records."""

NO_LIMIT_DEG = 90.0


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
        failed_tests: which tests of the model failed.
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
    failed_tests: tuple[str, ...] = ()
    reason: str = ""

    @property
    def is_covered(self) -> bool:
        """Whether the error of a visit is within U of the stated one."""
        return abs(self.value_mm - self.once_mm) <= self.u_mm

    @property
    def is_false_pass(self) -> bool:
        """Whether the verdict is a pass although the expected error is above the limit."""
        return self.verdict is Verdict.PASS and self.true_mm > self.trial.limit_mm

    @property
    def is_false_pass_with_u(self) -> bool:
        """Whether it would be one with a guard band of U alone."""
        is_within = self.value_mm + self.u_mm <= self.trial.limit_mm
        return is_within and self.true_mm > self.trial.limit_mm and not self.failed_tests


def carry_out(trial: Trial) -> Outcome:
    """Measure, identify, state and compare."""
    world, own = world_of(trial)
    try:
        robot = replace(own.robot, effects=budgets.machine(trial.grade))
        found = identify(robot.problem(world.records(own.commands, robot.commanding)))
        return _judged(trial, replace(world, robot=robot), found)
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
    stated = settings_with_limit(trial)
    written = world.robot.with_controller(world.robot.for_controller(found.geometry))
    hour = world.hours(own.commands, world.robot.commanding)
    says = _verified(stated, replace(world, robot=written), found, own, hour)
    belief = written.belief(found)
    task = Task.of(stated, written, belief).reachable(belief)
    errors = world.errors(found.geometry, task.poses, task.workspace, hour)
    faults = KINDS[trial.kind].faults
    accuracy = says.accuracy
    return Outcome(
        trial=trial,
        verdict=says.verdict,
        true_mm=errors.largest_mm,
        once_mm=errors.largest_once_mm,
        value_mm=np.nan if accuracy is None else accuracy.position.value,
        u_mm=np.nan if accuracy is None else accuracy.position.expanded,
        sigma_mm=task_sigma_mm(found, belief, task),
        ratio=found.goodness.ratio,
        named=tuple(str(fault.kind) for fault in found.data_faults),
        is_wrongly_named=any(fault.kind not in faults for fault in found.data_faults),
        failed_tests=tuple(test.name for test in says.tests if not test.passed),
    )


def _verified(
    settings: CellSettings, world: World, found: Identification, own: Setting, hour: float
) -> Verification:
    """By held-out records, and where a test of the model fails narrowly by confirming ones after them."""
    held_out = _held_out(world, found, own.held_out, hour)
    says = verify(settings, world.robot, found, held_out)
    if not says.needs_confirmation:
        return says
    later = world.hours(own.held_out, found.geometry, hour)
    records = _records(world, found, own.confirming, later, CONFIRMING_FROM)
    return verify(settings, world.robot, found, replace(held_out, confirming=records))


def settings_with_limit(trial: Trial) -> CellSettings:
    """The cell of a machine of some grade, with a limit on the position alone."""
    stated = budgets.settings_of(trial.grade)
    limits = {"position_mm": trial.limit_mm, "orientation_deg": NO_LIMIT_DEG}
    return stated.model_copy(update={"acceptance": stated.acceptance.model_copy(update=limits)})


def task_sigma_mm(found: Identification, belief: RobotBelief, task: Task) -> float:
    """One standard deviation at the worst task pose, by the noise of the records."""
    budget = task.budget(found, belief, ())
    return np.nan if budget is None else budget.noise_mm


def _held_out(world: World, found: Identification, commands: Commands, hour: float) -> HeldOut:
    """What the held-out poses give that are commanded with the identified geometry."""
    records = _records(world, found, commands, hour, HELD_OUT_FROM)
    deviations = [record.deviation for record in records.records if record.orientation > 1]
    return HeldOut(records, deviations, deviations)


def _records(
    world: World, found: Identification, commands: Commands, hour: float, first: int
) -> MeasurementSet:
    """The records of commands with the identified geometry, at points after the ``first``."""
    records = world.records(commands, found.geometry, hour).records
    return MeasurementSet(tuple(replace(record, point=record.point + first) for record in records))
