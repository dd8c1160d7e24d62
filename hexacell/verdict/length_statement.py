"""What a length check of its own says: the scale of the encoders, and what that does at the task."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.fields import Frozen
from hexacell.cell.model import CellSettings
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.rotations import Array
from hexacell.results.length_result import LengthMeasurements, LengthResult, encoders_read, length_check
from hexacell.results.result import AcceptedResult
from hexacell.robot.model import Robot
from hexacell.uncertainty.length_errors import JudgedGeometry
from hexacell.uncertainty.scale_observation import errors_by_scale
from hexacell.uncertainty.statement import COVERAGE_FACTOR, TaskErrors
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import JudgedError


class LengthStatement(Frozen):
    """The result of a length check, and the verdict on what the scale alone does.

    Attributes:
        error: the largest position error that it makes at the task poses, mm; none where the robot can
            take none of them.
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
    result = LengthResult.of(check, settings.uncertainty.common_scale_um_m)
    known = judged.with_scale(belief.mechanism, belief.estimate).parameter_columns
    error = _error(settings, robot, belief, known, result)
    return LengthStatement(verdict=_verdict(result, error), result=result, error=error)


def length_line(stated: LengthStatement) -> str:
    """The outcome of a length check in one line."""
    result, error = stated.result, stated.error
    if not result.is_consistent:
        return f"length check: {stated.verdict} ({result.reason})"
    parts = [f"length check over {result.distance_mm:.3f} mm: {encoders_read(result)}"]
    if error is not None:
        parts.append(f"position error by that {error.value:.3f} +- {error.expanded:.3f} mm ({error.rule})")
    return f"{'; '.join(parts)}: {stated.verdict}"


def _verdict(result: LengthResult, error: JudgedError | None) -> Verdict:
    return error.verdict if result.is_consistent and error is not None else Verdict.NOT_EVALUATED


def _error(
    settings: CellSettings,
    robot: Robot,
    belief: RobotBelief,
    known: Mapping[str, Array],
    result: LengthResult,
) -> JudgedError | None:
    task = Task.of(settings, robot, belief).reachable(belief)
    if not len(task.poses):
        return None
    unit = errors_by_scale(belief, task.poses, task.workspace, known)
    sigma = result.expanded_um_m / COVERAGE_FACTOR
    errors = TaskErrors(-result.long_um_m * unit, sigma * unit[..., np.newaxis])
    limits = settings.acceptance
    return JudgedError.of(errors.position, limits.position_mm, limits.guard_band_factor)
