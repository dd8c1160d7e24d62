"""A length check: the scale of all encoders from two seats, whether its records hold, and the verdict."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.fields import Frozen
from hexacell.cell.model import CellSettings
from hexacell.cell.uncertainty import LengthCheckSettings
from hexacell.identification.placement import Placement, RecordPlacement
from hexacell.identification.solver.chi_square import SMALLEST_PROBABILITY
from hexacell.kinematics.geometry import Geometry
from hexacell.measurements.records import MeasurementSet
from hexacell.results.result import AcceptedResult, LengthResult, LengthSource
from hexacell.robot.model import Robot
from hexacell.uncertainty.effect_kinds import COMMON_SCALE
from hexacell.uncertainty.effects import Effect
from hexacell.uncertainty.length_check import LengthCheck
from hexacell.uncertainty.length_records import JudgedGeometry, LengthRecords, LengthStandard
from hexacell.uncertainty.propagation import errors_by_scale
from hexacell.uncertainty.statement import COVERAGE_FACTOR, TaskErrors
from hexacell.verdict.decision import JudgedError, Verdict

WRONG_WAY_SLOPE = 0.5
"""A gauge that follows the ball by less than this share has another direction than it should have."""


@dataclass(frozen=True, slots=True, eq=False)
class LengthMeasurements:
    """What was measured in the two seats.

    Attributes:
        records: their points are the numbers of the mountings.
        celsius: mean temperature of the fixture; None without a thermometer on it.
    """

    records: MeasurementSet
    celsius: float | None = None


class LengthStatement(Frozen):
    """The result of a length check, and the verdict on what the scale alone does.

    Attributes:
        error: the largest position error that the scale makes at the task poses, mm; None where the robot
            can reach none of them.
    """

    verdict: Verdict
    result: LengthResult
    error: JudgedError | None = None


def length_statement(
    settings: CellSettings, robot: Robot, accepted: AcceptedResult, measured: LengthMeasurements
) -> LengthStatement:
    """The statement on a ``robot`` whose controller has an accepted result.

    Raises:
        IdentifiabilityError: the joint variables do not belong to the commanded poses.
    """
    belief = robot.belief()
    judged = JudgedGeometry(belief.covariance, accepted.parameter_columns)
    check = length_check(settings, robot, belief.estimate, judged, measured, robot.effects)
    result = length_result(check, settings.uncertainty.common_scale_um_m)
    known = judged.with_scale(belief.mechanism, belief.estimate).parameter_columns
    task, error = Task.of(settings, robot, belief).reachable(belief), None
    if len(task.poses):
        unit = errors_by_scale(belief, task.poses, task.workspace, known)
        sigma, limits = result.expanded_um_m / COVERAGE_FACTOR, settings.acceptance
        errors = TaskErrors(-result.long_um_m * unit, sigma * unit[..., np.newaxis])
        limit = limits.position_mm, limits.guard_band_factor
        error = JudgedError.of(errors.position, *limit, is_evident=result.is_consistent)
    verdict = Verdict.NOT_EVALUATED if error is None else error.verdict
    return LengthStatement(verdict=verdict, result=result, error=error)


def length_check(
    settings: CellSettings,
    robot: Robot,
    geometry: Geometry,
    judged: JudgedGeometry,
    measured: LengthMeasurements,
    effects: Iterable[Effect],
) -> LengthCheck:
    """The check of a geometry, in the frame convention, that commands ``robot``, or nearly that one.

    Raises:
        IdentifiabilityError: the joint variables do not belong to the commanded poses.
    """
    fixture = settings.length_check
    assert fixture is not None  # noqa: S101 - a run without one has no such records
    poses, warmer = robot.frames.poses(measured.records.poses), robot.expansion.warmer(measured.records)
    shown = Placement(robot.mechanism, geometry, poses, measured.records.joints)
    commanded = RecordPlacement(
        robot.mechanism,
        geometry,
        poses,
        robot.expansion.joints_without(shown, warmer),
        robot.frames.deviations(measured.records.deviations),
        robot.frames.base,
        measured.records.directions,
        warmer,
    )
    records = LengthRecords.of(commanded, measured.records.points)
    return LengthCheck.of(records, length_standard(fixture, measured.celsius), robot.noise, judged, effects)


def length_standard(fixture: LengthCheckSettings, celsius: float | None = None) -> LengthStandard:
    """The fixture as it is at a temperature; without one, at that of the cell file."""
    warmer = (fixture.temperature_c if celsius is None else celsius) - fixture.certified_at_c
    return LengthStandard(
        distance_mm=fixture.distance_mm * (1.0 + 1e-6 * fixture.expansion_um_m_k * warmer),
        certificate_mm=fixture.uncertainty_mm / COVERAGE_FACTOR,
        temperature_um_m=fixture.expansion_um_m_k * fixture.temperature_sigma_k,
        parallel=1e-3 * fixture.parallel_mrad,
        height_mm=fixture.height_mm,
        seating_mm=1e-3 * fixture.seating_um,
    )


def length_result(check: LengthCheck, stated_um_m: float) -> LengthResult:
    """The result of a check; ``stated_um_m`` is the size of the common scale by the cell file."""
    reason = contradiction(check)
    return LengthResult(
        distance_mm=check.standard.distance_mm,
        length_mm=check.length_mm,
        long_um_m=check.encoders_long_um_m,
        expanded_um_m=check.expanded_um_m,
        stated_um_m=stated_um_m,
        sources=tuple(LengthSource(name=name, um_m=size) for name, size in check.lines.items()),
        is_consistent=not reason,
        reason=reason,
    )


def contradiction(check: LengthCheck) -> str:
    """Why the records of a check cannot be what it presupposes; empty if they can."""
    for mounting, followed in check.following().items():
        gauges = [axis for axis, slope in zip("xyz", followed, strict=True) if slope < WRONG_WAY_SLOPE]
        if gauges:
            runs = "run" if len(gauges) > 1 else "runs"
            return (
                f"at mounting {mounting} gauge {' and '.join(gauges)} {runs} against the ball: the gauges "
                "are the wrong way round in their seat"
            )
    if check.closure.probability < SMALLEST_PROBABILITY:
        off = ", ".join(f"{axis} {mm:+.3f}" for axis, mm in zip("xyz", check.closure_mm, strict=True))
        return (
            f"back in the first seat the gauges are {off} mm off: they were zeroed in between, or the "
            "fixture or a gauge has moved"
        )
    if check.agreement.probability < SMALLEST_PROBABILITY:
        return f"its records are {check.agreement.ratio:.1f} times as far off as all sources explain"
    return ""


def with_measured_scale(effects: Iterable[Effect], length: LengthResult | None) -> tuple[Effect, ...]:
    """Effects with the scale that the length check ``length`` found, if there was one.

    Only where the check says more than the cell file does the scale have its value and its uncertainty.
    """
    if length is None or not length.replaces_stated:
        return tuple(effects)
    sigma, value = length.expanded_um_m / COVERAGE_FACTOR, -length.long_um_m
    return tuple(
        replace(one, size=sigma, value=value, source="length check") if one.name == COMMON_SCALE else one
        for one in effects
    )
