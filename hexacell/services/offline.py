"""Geometry, next pose, dry run and reach of the stated poses, by cell file and measurements alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hexacell.campaign import decisions, feasibility
from hexacell.campaign.feasibility import unreachable_share
from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_list import pose_list_of
from hexacell.campaign.time_model import lost_to_speed
from hexacell.cell.loader import Cell
from hexacell.errors import FileError, HexacellError, UsageError, joined
from hexacell.identification.estimator import identify
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.identification.problem.random_walk import NO_WALK
from hexacell.identification.thermal_expansion import known_parts
from hexacell.measurements.records import MeasurementSet, RecordId
from hexacell.noise.measured_noise import AveragingForecast, with_measured_noise
from hexacell.robot.model import robot_of
from hexacell.robot.stated import stated_effects
from hexacell.runs.run_folder import RunFolder
from hexacell.services import search_effort
from hexacell.services.design_facts import StatedPose, require_design, stated_poses
from hexacell.verdict.assessment import Assessment, assess

if TYPE_CHECKING:
    from hexacell.dry_run.campaign import DryRunResult

MOST_RECORDS_BEFORE_NEXT = 500
"""The estimate is made again record by record, as in a run."""


@dataclass(frozen=True, slots=True)
class NextPose:
    """What to measure next.

    Attributes:
        forecast: None where the robot can reach no task pose.
        left_out: records so far that the others prove false.
    """

    decision: decisions.StartPoint | decisions.MeasurePose | decisions.Finished
    forecast: decisions.Forecast | None
    left_out: tuple[RecordId, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanTrial:
    """A plan carried out on simulated robots.

    Attributes:
        unreachable: share of the robots within the tolerances that cannot reach a point, by point.
        target_mm: U at which measuring ends, if the cell file states one.
        averaging: what means of more readings would gain if all noise differed from reading to reading.
        encoders_part_mm: what the encoders contribute to the first of these errors.
        lost_to_speed: minutes that a calibration would take less at twice the speeds with gauges.
        never_seen: what no record of such a robot shows; empty where that is its frames alone.
        like: the run whose moves and readings it is expected to be as slow as; empty: the usual ones.
    """

    result: DryRunResult
    unreachable: Mapping[int, float]
    target_mm: float | None
    averaging: tuple[AveragingForecast, ...] = ()
    encoders_part_mm: float | None = None
    lost_to_speed: float = 0.0
    like: str = ""
    never_seen: str = ""


def fit_measurements(
    cell: Cell,
    measurements: MeasurementSet,
    folder: RunFolder | None = None,
    identify_only: ParameterChoice | None = None,
) -> Assessment:
    """Identify the geometry of a cell's robot from records, and check it.

    Args:
        cell: the cell, as :func:`~hexacell.cell.loader.load_cell` gives it.
        measurements: its records, of two poses or more at each point.
        folder: where the records are kept; if it is that of a run, what commanded them, and the noise and
            drift that it measured, come from its journal.
        identify_only: the parameters that are identified, in place of what the cell file states.

    Returns:
        The geometry with its covariance, and the checks of both; each parameter in its own unit.

    Raises:
        IdentifiabilityError: the records cannot determine it.
        FileError: the controller's config cannot be read.
    """
    require_own_joints(cell, measurements)
    robot, settings, measured = robot_of(cell), cell.settings, None
    if folder is not None and folder.journal.is_file():
        from hexacell.services.history.recorded_cell import commanding_geometries, recorded_state  # noqa: PLC0415 - only for a run

        run = recorded_state(folder, settings)
        robot = replace(robot, earlier=(*commanding_geometries(run, robot.mechanism), *robot.earlier))
        if run.noise is not None:
            measured = run.noise.noise
            settings = with_measured_noise(settings, measured)
            robot = robot.with_errors_of(settings)
        robot = replace(robot, noise=replace(robot.noise, walk=run.walk))
    temperatures = (one.temperatures for one in measurements.records)
    known = known_parts(temperatures, robot.mechanism.joint_count)
    robot = replace(robot, effects=stated_effects(settings, known=known))
    if identify_only is not None:
        robot = replace(robot, identifies=identify_only)
    found = identify(robot.problem(measurements))
    if robot.noise.walk.step_mm and not found.goodness.is_explained:  # no drift explains it: as in the run
        robot = replace(robot, noise=replace(robot.noise, walk=NO_WALK))
        found = identify(robot.problem(measurements))
    return assess(settings, robot, measurements, found, measured_noise=measured)


def require_own_joints(cell: Cell, measurements: MeasurementSet) -> None:
    """Require that records have as many joint variables as a cell's robot has joints.

    Raises:
        UsageError: they have others.
    """
    own = cell.settings.mechanism.joint_count
    for record in measurements.records:
        if len(record.joints) != own:
            raise UsageError(
                f"the records have q1 to q{len(record.joints)}, and the robot has {own} joints",
                action=f"Give the columns q1 to q{own}, or name the cell of the robot that was measured",
            )


def next_pose(cell: Cell, measurements: MeasurementSet, *, rejections: int = 0) -> NextPose:
    """The pose worth measuring after these records.

    Args:
        cell: the cell.
        measurements: its records so far; there may be none.
        rejections: number of poses at the present point that could not be measured.

    Returns:
        The next pose, mm and deg, or that measuring is done; the predicted error at the task poses, mm.

    Raises:
        HexacellError: a point is out of reach, the records do not belong to this cell, or no geometry fits
            them.
    """
    require_own_joints(cell, measurements)
    if len(measurements) > MOST_RECORDS_BEFORE_NEXT:
        raise UsageError(
            f"there are {len(measurements)} records; a next pose is found for {MOST_RECORDS_BEFORE_NEXT}",
            action="Use `hexacell fit`; some 60 records identify a robot",
        )
    plan = plan_of(cell)
    stated = stated_poses(cell.settings, has_list=plan.pose_list is not None)
    _require(cell, plan, (one for one in stated if one[0][0] == "identification"))
    state = _state_of_records(plan, measurements, rejections)
    decision = _decide(plan, state)
    forecast = decision.forecast if isinstance(decision, decisions.MeasurePose) else plan.forecast(state)
    return NextPose(decision, forecast, tuple(sorted(plan.estimate(state).false_records)))


def try_plan(cell: Cell) -> PlanTrial:
    """Carry out a cell's plan on robots drawn within its tolerances; raises as :func:`plan_of`."""
    from hexacell.dry_run.campaign import dry_run  # noqa: PLC0415 - takes seconds anyway
    from hexacell.noise import noise_assessment  # noqa: PLC0415 - likewise
    from hexacell.services.history.recorded_cell import last_overheads  # noqa: PLC0415 - likewise

    plan, (overheads, like) = plan_of(cell), last_overheads(cell)
    windows, noise = noise_assessment.WINDOWS, plan.robot.noise
    averaged = {number: noise_assessment.mean_of_independent(noise, number) for number in windows}
    return PlanTrial(
        dry_run(plan, overheads),
        unreachable_share(plan),
        cell.settings.identification.target_mm,
        noise_assessment.averaging_forecasts(plan, averaged),
        noise_assessment.encoders_part(plan, noise),
        lost_to_speed=lost_to_speed(cell.settings),
        like=like,
        never_seen=cell.settings.mechanism.words.never_seen,
    )


def plan_of(cell: Cell) -> Plan:
    """The plan of a cell; raises ``FileError`` if its config or its list of poses cannot be read."""
    return Plan(cell.settings, robot_of(cell), pose_list_of(cell), search_effort.EFFORT)


def _state_of_records(plan: Plan, measurements: MeasurementSet, rejections: int) -> decisions.CampaignState:
    """The state after the last record: the gauges are at its point, all other points are done."""
    for point in measurements.points.tolist():
        if point not in plan.points:
            raise UsageError(
                f"there are records of point {point}, but the cell file has {len(plan.points)} points",
                action="Take the measurement file and the cell file that belong together",
            )
    if not len(measurements):
        return decisions.CampaignState(rejections=rejections)
    last = measurements.records[-1]
    others = frozenset(measurements.points.tolist()) - {last.point}
    return decisions.CampaignState(measurements, last.point, others, last.pose, rejections)


def _decide(
    plan: Plan, state: decisions.CampaignState
) -> decisions.StartPoint | decisions.MeasurePose | decisions.Finished:
    """What to measure now; where a point is done, at the next one."""
    decision = plan.decide(state)
    if isinstance(decision, decisions.FinishPoint):
        leaving = replace(state, point=None, done=state.done | {decision.point}, present=None, rejections=0)
        decision = plan.decide(leaving)
    if isinstance(decision, decisions.FinishPoint):  # impossible: between points there is none to finish
        raise TypeError(decision)
    return decision


def require_stated_poses(cell: Cell) -> None:
    """Check that the design can work, and that the controller can take every stated pose within the limits.

    Raises ``FileError``, with its line, if something is wrong, ``SeveralErrors`` if more than one thing is.
    """
    require_design(cell)
    plan = plan_of(cell)
    _require(cell, plan, stated_poses(cell.settings, has_list=plan.pose_list is not None))


def _require(cell: Cell, plan: Plan, stated: Iterable[StatedPose]) -> None:
    failures: list[HexacellError] = [
        FileError(
            f"{name}: {failure.problem}",
            subject=cell.path,
            line=cell.document.line_of(path),
            action=failure.action or "Move it into the reach of the robot, or correct the limits",
        )
        for path, name, pose in stated
        for failure in feasibility.pose_failures(plan, name, pose)
    ]
    if plan.pose_list is not None:  # a file of its own
        failures += feasibility.reach_failures(plan)
    if failures:
        raise joined(f"{cell.path} has {len(failures)} mistakes", failures)
