"""A whole calibration of a virtual robot: measured as planned, identified, written, and verified."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hexacell.campaign.planner import Plan
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.config.interface import ControllerGeometry
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import HexacellError, LimitError
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.noise.allowances import Allowances
from hexacell.noise.measured_noise import MeasuredNoise, with_measured_noise
from hexacell.noise.noise_assessment import NoiseReadings, assess_again, assess_noise
from hexacell.noise.repeats import SIGNIFICANCE, Repeats
from hexacell.results.written_geometry import as_written
from hexacell.robot.model import Robot, make_robot
from hexacell.robot.virtual_robot import VirtualRobot, random_robot
from hexacell.verdict.decision import Verdict
from hexacell.verdict.model_evidence import BEYOND_CHANCE
from hexacell.verdict.scatter_evidence import JudgedResult, verify_with_scatter
from hexacell.verdict.verification import HeldOut, Verification
from procedures.calibration.held_out_poses import HeldOutPoses
from procedures.run.keys import SixNumbers
from tests.benchmarks.worlds.effects import Effect
from tests.benchmarks.worlds.trials import Stated, figures_of, unmet_gates
from tests.benchmarks.worlds.world import World

HELD_OUT_FROM, AFTER_FROM, CONFIRMING_FROM = 100, 200, 300
"""Points of the held-out records before and after, and of the confirming ones: of no other records."""

CANDIDATES = 512


@dataclass(frozen=True, slots=True)
class Scatter:
    """One standard deviation of where a joint stops, in its unit: seen by its encoder, and beside that."""

    seen: float = 0.0
    unseen: float = 0.0

    def virtual(self, robot: Robot, truth: Geometry, random: np.random.Generator) -> VirtualRobot:
        """A robot that stops so."""
        return VirtualRobot(robot, truth, random, stops=self.seen, unseen=self.unseen)


REPEATS = Scatter()


@dataclass(frozen=True, slots=True, eq=False)
class VirtualCalibration:
    """A calibration; ``after`` is the robot with the result in its controller."""

    found: Identification
    after: Robot
    verification: Verification
    outside: int


@dataclass(frozen=True, slots=True, eq=False)
class Judged(Stated):
    """What was stated of a calibration's result, and what is true of it.

    ``reason``: where no result was verified, a test of the model failed, or the orientation does not pass.
    ``outside``: records at which the ball left the gauges' travel. ``unmet``: acceptance gates that would
    leave it waiting for a person, or refuse it.
    """

    truth: Geometry
    done: VirtualCalibration | None = None
    verdict: Verdict | None = None
    is_refused: bool = False
    true_mm: float = np.nan
    value_mm: float = np.nan
    u_mm: float = np.nan
    limit_mm: float = np.nan
    outside: int = 0
    reason: str = ""
    unmet: tuple[str, ...] = ()

    @property
    def is_covered(self) -> bool:
        """Whether the true error is within U of the stated one."""
        return abs(self.value_mm - self.true_mm) <= self.u_mm

    @property
    def is_false_pass(self) -> bool:
        """Whether it passes though the true error is above the limit, or not known."""
        return self.verdict is Verdict.PASS and not self.true_mm <= self.limit_mm


TrueError = Callable[[Robot, Geometry, Identification, Task], float]
"""The largest true position error, mm, over the poses of a task, with what was found in the controller."""


def by_leg_equations(after: Robot, truth: Geometry, found: Identification, task: Task) -> float:
    """A Hexaglide's, by equations that owe nothing to the code under test."""
    errors = World(after, truth, Effect(), 0).errors(found.geometry, task.poses, task.workspace)
    return errors.largest_mm


def by_derivatives(after: Robot, truth: Geometry, found: Identification, task: Task) -> float:
    """Any mechanism's."""
    budget = task.budget(found, after.belief(found), after.effects, {})
    assert budget is not None
    off = found.free - after.mechanism.convention.free_parameters(truth)
    return float(budget.errors_of(off).position.value)


def judged(
    cell: Cell,
    robot: Robot,
    truth: Geometry,
    random: np.random.Generator,
    true_error: TrueError,
    scatter: Scatter = REPEATS,
) -> Judged:
    """Carry a calibration out, and compare what is stated with the truth."""
    try:
        done = calibrate(cell, robot, truth, random, scatter)
    except HexacellError as failed:
        return Judged(truth, reason=str(failed))
    found, after, says = done.found, done.after, done.verification
    is_refused = bool(robot.tolerance_violations(found.estimate))
    unmet = unmet_gates(cell.settings, robot, found)
    reason = ", ".join(test.sentence for test in says.tests if not test.passed)
    true_mm = np.nan
    if says.accuracy is None:
        reason = reason or "no accuracy"
    else:
        belief, turned = after.belief(found), says.accuracy.orientation
        task = Task.of(cell.settings, after, belief).reachable(belief)
        true_mm = true_error(after, truth, found, task)
        if not reason and turned.verdict is not Verdict.PASS:
            reason = f"orientation {turned.with_u('deg')}"
    stated, limit = figures_of(says.accuracy), cell.settings.acceptance.position_mm
    outcome = is_refused, true_mm, *stated, limit, done.outside, reason, unmet
    return Judged(truth, done, says.verdict, *outcome)


def robot_that_reaches(cell: Cell, robot: Robot, random: np.random.Generator) -> Geometry:
    """A geometry within the tolerances that can stand at all points as its controller sends it there."""
    while True:
        truth = random_robot(robot.mechanism, robot.drawing, robot.tolerances, random)
        poses = robot.from_commands(Pose(*point) for point in cell.settings.identification.points)
        if VirtualRobot(robot, truth).can_take(poses).all():
            return truth


def robot_that_stands(
    cell: Cell, robot: Robot, random: np.random.Generator, *, at_first: bool = False
) -> Geometry:
    """A robot whose passive joints and legs keep their limits too, at all points as it is sent there.

    Another one would stand at a stop of a joint before it was calibrated. ``at_first``: at the first point
    alone, where it goes before anything is known.
    """
    points = cell.settings.identification.points[: 1 if at_first else None]
    while True:
        truth = robot_that_reaches(cell, robot, random)
        if stands_at(robot, truth, points):
            return truth


def stands_at(robot: Robot, truth: Geometry, points: Sequence[Sequence[float]]) -> bool:
    """Whether passive joints and legs keep their limits at some commands in the controller's frames."""
    commands = robot.from_commands(Pose(*point) for point in points)
    return bool(VirtualRobot(robot, truth).can_stand(commands).all())


def calibrate(
    cell: Cell, robot: Robot, truth: Geometry, random: np.random.Generator, scatter: Scatter = REPEATS
) -> VirtualCalibration:
    """Measure noise and records, identify, write and verify.

    Raises:
        HexacellError: a run would end with this message.
    """
    plan = Plan(cell.settings, robot, with_forecast=False)
    readings = _visits(cell.settings, scatter.virtual(robot, truth, random))
    noise = MeasuredRun(plan, readings, assess_noise(plan, readings))
    settings, robot = noise.settings(), noise.robot(robot)
    Allowances(cell.settings, robot, is_measured=True).require_travel(readings.reference)
    campaign = _ClosedCampaign(
        Plan(settings, robot, with_forecast=False), scatter.virtual(robot, truth, random)
    )
    campaign.carry_out()
    noise, measurements = replace(noise, closings=campaign.closings), campaign.measurements
    first = identify(noise.robot(campaign.plan.robot).problem(measurements))
    found = identify(noise.robot(campaign.plan.robot, first).problem(measurements))
    written = as_written(settings, robot, found.geometry).geometry
    after = make_robot(settings, ControllerGeometry(written, robot.branch), taught=written)

    def beyond_chance() -> JudgedResult:
        certain = replace(noise, significance=BEYOND_CHANCE)
        found = identify(certain.robot(campaign.plan.robot, first).problem(measurements))
        return JudgedResult(certain.robot(after, first), found)

    result = JudgedResult(noise.robot(after, first), found)
    verification = verification_of(settings, result, beyond_chance, robot, (truth, random), scatter)
    return VirtualCalibration(found, result.robot, verification, campaign.outside)


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """What a run has measured of its noise; ``closings``: reference, first and last reading of points."""

    plan: Plan
    readings: NoiseReadings
    noise: MeasuredNoise
    closings: Sequence[tuple[Pose, Array, Array]] = ()
    significance: float = SIGNIFICANCE

    def settings(self) -> CellSettings:
        """Of the cell, with that noise."""
        return with_measured_noise(self.plan.settings, self.noise)

    def robot(self, robot: Robot, found: Identification | None = None) -> Robot:
        """A robot with the noise that all repeats show, by what was found or is drawn of its geometry."""
        noise = self.noise if found is None else assess_again(self.plan, self.readings, self.noise, found)
        robot = robot.with_errors_of(with_measured_noise(self.plan.settings, noise))
        measuring = replace(self.plan.robot, noise=robot.noise)
        allowances = Allowances(self.plan.settings, measuring, is_measured=True, found=found)
        visits = allowances.between_visits(self.readings.reference, self.readings.visits)
        changes = [*visits, *(allowances.since(*one) for one in self.closings)]
        about = noise.approaches, changes, robot.noise, found
        return Repeats.of(*about, significance=self.significance).applied_to_robot(robot)


def _visits(settings: CellSettings, virtual: VirtualRobot) -> NoiseReadings:
    """The first reference visited as often as a run visits it."""
    reference, shown = Pose(*settings.identification.points[0]), []
    for _ in range(1 + settings.noise.revisits):
        virtual.place(reference)
        record = virtual.measure(1, 1)
        shown.append([*record.deviation, *record.joints])
    return NoiseReadings(reference, np.empty((0, 9)), np.zeros(9), np.array(shown), window_readings=1)


@dataclass(eq=False)
class _ClosedCampaign(VirtualCampaign):
    """A campaign that reads each reference again before it leaves it, as a run does."""

    closings: list[tuple[Pose, Array, Array]] = field(default_factory=list)

    def _return_to(self, reference: Pose) -> None:
        self.virtual_robot.place(reference)
        point = self.state.point
        records = [record for record in self.measurements.records if record.point == point]
        if point is None or len(records) < 2:
            return
        before, now = (
            np.array([*one.deviation, *one.joints])
            for one in (records[0], self.virtual_robot.measure(point, 1))
        )
        self.closings.append((reference, before, now))


def verification_of(
    settings: CellSettings,
    result: JudgedResult,
    beyond_chance: Callable[[], JudgedResult],
    before: Robot,
    actual: tuple[Geometry, np.random.Generator],
    scatter: Scatter = REPEATS,
) -> Verification:
    """What a run states of a result: held-out poses before and after, and new ones after a narrow failure.

    Args:
        beyond_chance: the result with that scatter alone which is beyond chance.
        before: the robot with the controller's previous geometry.
        actual: the robot's geometry, and the source of all noise.

    Raises:
        HexacellError: a run would end with this message.
    """
    after, found = result
    common = HeldOutPoses(settings, before, CANDIDATES).before(found)
    chosen = HeldOutPoses(settings, after, CANDIDATES)
    wide = chosen.after(found, common)
    old = _visited(scatter.virtual(before, *actual), common, HELD_OUT_FROM)
    both = [first + more for first, more in zip(common, wide, strict=True)]
    new = _visited(scatter.virtual(after, *actual), both, AFTER_FROM)
    if scatter != REPEATS:  # a ball that leaves the travel by chance costs a pose, in both phases
        old, new = _inside(before, old, new)
    if not _keeps_travel(before, old):
        raise LimitError("the ball left the gauges' travel at a held-out pose")
    compared = [one for one in new if one.orientation <= len(common[one.point - AFTER_FROM])]
    held_out = HeldOut(
        MeasurementSet((*old, *new)),
        _deviations(old),
        _deviations(compared),
        left_travel=not _keeps_travel(after, new),
    )
    verified = verify_with_scatter(settings, result, beyond_chance, held_out)
    if not verified.needs_confirmation:
        return verified
    poses = chosen.confirming(found, common, wide)
    records = _visited(scatter.virtual(after, *actual), poses, CONFIRMING_FROM)
    confirming = MeasurementSet(tuple(_inside(after, records, records)[0]))
    if not confirming:
        return verified
    return verify_with_scatter(settings, result, beyond_chance, replace(held_out, confirming=confirming))


def _visited(virtual: VirtualRobot, points: Sequence[Sequence[SixNumbers]], first: int) -> list[Record]:
    """The records of some poses at each point, numbered from the ``first``; none of a point that is left.

    Raises:
        ReachError: it cannot take one of them.
    """
    records: list[Record] = []
    for number, poses in enumerate(points, start=first):
        virtual.zero_gauges()
        for orientation, pose in enumerate(poses, start=1):
            virtual.place(Pose(*pose))
            records.append(virtual.measure(number, orientation))
    return records


def _inside(robot: Robot, old: list[Record], new: list[Record]) -> tuple[list[Record], list[Record]]:
    """Records of both phases without those of poses at which the ball left the gauges' travel in either."""

    def pose(record: Record) -> tuple[int, int]:
        return record.point % HELD_OUT_FROM, record.orientation

    left = {pose(one) for one in (*old, *new) if not _keeps_travel(robot, [one])}
    return [one for one in old if pose(one) not in left], [one for one in new if pose(one) not in left]


def _deviations(records: Sequence[Record]) -> list[tuple[float, float, float]]:
    """At all poses but the references."""
    return [record.deviation for record in records if record.orientation > 1]


def _keeps_travel(robot: Robot, records: Sequence[Record]) -> bool:
    return bool(robot.limits.room.holds(np.array([record.deviation for record in records])).all())
