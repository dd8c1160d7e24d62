"""One world measured, identified, stated and compared with what it really does."""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.cell.uncertainty import Grade
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import GaugeFaultError, Identification
from hexacell.measurements.records import MeasurementSet
from hexacell.results.result import IdentificationResult
from hexacell.robot.model import Robot
from hexacell.verdict.acceptance_gates import gates_of_run
from hexacell.verdict.decision import Verdict, VerifiedAccuracy
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


class Stated:
    """What is stated of a result: verdict, U, and the gates of a run that it does not meet, in words."""

    verdict: Verdict | None
    u_mm: float
    unmet: tuple[str, ...]

    @property
    def is_stated(self) -> bool:
        """Whether U is stated: not where the evidence failed, or nothing could be judged."""
        return bool(np.isfinite(self.u_mm))

    @property
    def is_accepted(self) -> bool:
        """Whether a run writes it without a person, and it passes."""
        return self.verdict is Verdict.PASS and not self.unmet


@dataclass(frozen=True, slots=True)
class Outcome(Stated):
    """What came of a trial.

    Attributes:
        verdict: none if there is no geometry that could be judged.
        true_mm: the largest expected error at a task pose of the identified geometry.
        once_mm: the largest error of one visit of each.
        value_mm: what is stated of it, and its ``u_mm``.
        is_wrongly_named: whether a data fault was said to be in the records that is not in this world.
        unmet: see :func:`unmet_gates`.
    """

    trial: Trial
    verdict: Verdict | None = None
    true_mm: float = np.nan
    once_mm: float = np.nan
    value_mm: float = np.nan
    u_mm: float = np.nan
    is_wrongly_named: bool = False
    unmet: tuple[str, ...] = ()

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
        robot = replace(own.robot, effects=budgets.machine(trial.grade))
        found = identify(robot.problem(world.records(own.commands, robot.commanding)))
        return _judged(trial, replace(world, robot=robot), found)
    except GaugeFaultError as refused:
        return Outcome(trial, is_wrongly_named=refused.fault.kind not in KINDS[trial.kind].faults)
    except (HexacellError, CannotCloseError):
        return Outcome(trial)


def world_of(trial: Trial) -> tuple[World, Setting]:
    """The world of a trial, the same for all multiples of its size, and what is measured there."""
    random = np.random.default_rng([23, trial.number, *trial.kind.encode()])
    own = settings()[trial.number % ROBOTS]
    seed = int(random.integers(1 << 31))
    return World(own.robot, own.truth, KINDS[trial.kind].world(trial.factor, random), seed), own


@cache
def settings(candidates: int = 64, terms: tuple[str, ...] = ()) -> tuple[Setting, ...]:
    """Of the first robots that can take the poses of a campaign; arguments as of :func:`.setting`."""
    found: list[Setting] = []
    number = 0
    while len(found) < ROBOTS:
        with suppress(UnreachableError):
            found.append(setting(number, candidates, terms))
        number += 1
    return tuple(found)


def _judged(trial: Trial, world: World, found: Identification) -> Outcome:
    own, stated = settings()[trial.number % ROBOTS], stated_limit(trial.limit_mm, trial.grade)
    written = world.robot.with_controller(world.robot.for_controller(found.geometry))
    hour = world.hours(own.commands, world.robot.commanding)
    says = verified(stated, replace(world, robot=written), found, own, hour)
    belief = written.belief(found)
    task = Task.of(stated, written, belief).reachable(belief)
    errors = world.errors(found.geometry, task.poses, task.workspace, hour)
    faults, accuracy = KINDS[trial.kind].faults, says.accuracy
    return Outcome(
        trial,
        says.verdict,
        errors.largest_mm,
        errors.largest_once_mm,
        *figures_of(accuracy),
        is_wrongly_named=any(fault.kind not in faults for fault in found.data_faults),
        unmet=unmet_gates(stated, world.robot, found),
    )


def unmet_gates(settings: CellSettings, robot: Robot, found: Identification) -> tuple[str, ...]:
    """The gates of a run that a result does not meet, in words: it then waits for a person, or is refused.

    No instrument here has a certificate, which could have expired. ``robot`` is as before the result.
    """
    result = IdentificationResult.of(found, robot.identified_zeros(found))
    return tuple(gate.sentence for gate in gates_of_run(settings, robot, result) if not gate.passed)


def figures_of(accuracy: VerifiedAccuracy | None) -> tuple[float, float]:
    """The largest position error and its U, mm, as they are stated; NaN for what is not."""
    if accuracy is None:
        return np.nan, np.nan
    position = accuracy.position
    return position.value, np.nan if position.expanded is None else position.expanded


def verified(
    settings: CellSettings, world: World, found: Identification, own: Setting, hour: float
) -> Verification:
    """By held-out records, and where a test of the model fails narrowly by confirming ones after them."""
    records = records_after(world, found, own.held_out, hour, HELD_OUT_FROM)
    deviations = [record.deviation for record in records.records if record.orientation > 1]
    held_out = HeldOut(records, deviations, deviations)
    says = verify(settings, world.robot, found, held_out)
    if not says.needs_confirmation:
        return says
    later = world.hours(own.held_out, found.geometry, hour)
    records = records_after(world, found, own.confirming, later, CONFIRMING_FROM)
    return verify(settings, world.robot, found, replace(held_out, confirming=records))


def stated_limit(limit_mm: float, grade: Grade = "precision") -> CellSettings:
    """The cell of a machine of some grade, with a limit on the position alone."""
    stated = budgets.settings_of(grade)
    limits = {"position_mm": limit_mm, "orientation_deg": NO_LIMIT_DEG}
    return stated.model_copy(update={"acceptance": stated.acceptance.model_copy(update=limits)})


def records_after(
    world: World, found: Identification, commands: Commands, hour: float, first: int
) -> MeasurementSet:
    """The records of commands with the identified geometry, at points after the ``first``."""
    records = world.records(commands, found.geometry, hour).records
    return MeasurementSet(tuple(replace(record, point=record.point + first) for record in records))
