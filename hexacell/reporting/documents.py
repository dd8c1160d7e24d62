"""An identification for programs: the ``fit --json`` document, and the outcome of a run in one line."""

from __future__ import annotations

from dataclasses import asdict
from itertools import zip_longest
from typing import Any

import numpy as np

from hexacell.acceptance.validation import DeviationStatistics, Verdict
from hexacell.experiment_design.decorrelation import DecorrelatingPose
from hexacell.identification.diagnostics.pose_accuracy import PoseErrors
from hexacell.identification.diagnostics.variance_components import NoiseLevels
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.result import DataFault, DataFaultKind, Identification
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import RecordId
from hexacell.reporting.assessment import Assessment
from hexacell.reporting.findings import findings


def identification_document(found: Identification) -> dict[str, Any]:
    """The document that ``hexacell fit --json`` prints (``docs/interface.md``)."""
    return {
        "converged": found.converged,
        "termination": found.termination.value,
        "iterations": found.iterations,
        "records": found.records,
        "points": found.points,
        "residual_rms_mm": found.residual_rms_mm,
        "chi2": found.chi2,
        "dof": found.dof,
        "geometry": found.geometry.document(),
        "sigma": found.geometry.parameters.document(found.sigma),
        "parameters": _parameters(found),
        "covariance": found.covariance.tolist(),
        "undetermined": list(found.undetermined),
        "outliers": [_outlier(record, fault) for record, fault in found.left_out],
        "frame": found.frame,
    }


def _parameters(found: Identification) -> list[dict[str, Any]]:
    """Every parameter with its value and standard deviation, in the order of the covariance."""
    values = zip(found.geometry.parameters.parameters, found.geometry.vector, found.sigma, strict=True)
    return [
        {
            "name": parameter.name,
            "kind": parameter.kind.symbol,
            "leg": parameter.leg,
            "unit": parameter.kind.unit.value,
            "value": float(value),
            "sigma": float(sigma),
        }
        for parameter, value, sigma in values
    ]


def _outlier(record: RecordId, fault: DataFault) -> dict[str, Any]:
    point, orientation = record
    # The gauges of a zero shift are named in its finding only.
    is_single_record = fault.kind is not DataFaultKind.ZERO_SHIFT
    return {
        "point": point,
        "orientation": orientation,
        "kind": fault.kind.value,
        "gauges": list(fault.gauges) if is_single_record else [],
        "off_mm": None if fault.offset_mm is None else list(fault.offset_mm),
    }


def assessment_document(found: Identification, assessed: Assessment) -> dict[str, Any]:
    """What ``hexacell fit --json`` adds: the checks of the result and its predicted accuracy."""
    return {
        "findings": list(findings(found, assessed)),
        "goodness": _goodness(assessed.goodness),
        "noise": _noise(assessed.noise),
        "repeatability": _repeatability(assessed),
        "correlated": _correlated(assessed),
        "accuracy": _accuracy(assessed),
        "refused": assessed.refused,
        "beyond_tolerance": [asdict(violation) for violation in assessed.tolerance_violations],
    }


def _goodness(goodness: ChiSquareTest) -> dict[str, Any]:
    return {
        "expected_chi2": goodness.expected,
        "probability": goodness.probability,
        "noise_ratio": goodness.ratio,
        "agreement": goodness.agreement.value,
    }


def _noise(noise: NoiseLevels | None) -> dict[str, Any] | None:
    if noise is None:
        return None
    levels = {
        name: {
            "stated": level.stated,
            "estimated": level.estimated,
            "standard_error": level.standard_error,
            "at_most": level.at_most,
            "seen": level.is_resolved,
        }
        for name, level in (("encoder_mm", noise.encoder), ("gauge_mm", noise.gauge))
    }
    return levels | {"correlation": noise.correlation, "told_apart": noise.are_separable}


def _repeatability(assessed: Assessment) -> dict[str, Any] | None:
    scatter = assessed.repeatability
    if scatter is None:
        return None
    return {
        "per_axis_mm": list(scatter.per_axis_mm),
        "distance_mm": scatter.distance_mm,
        "degrees_of_freedom": scatter.degrees_of_freedom,
        "poses": scatter.poses,
        "recalibrating_helps": not assessed.does_not_repeat,
    }


def _correlated(assessed: Assessment) -> list[dict[str, Any]]:
    return [
        {
            "parameters": [pair.first, pair.second],
            "correlation": pair.correlation,
            "measure": pose and _decorrelating_pose(pose),
        }
        for pair, pose in zip_longest(assessed.correlated, assessed.decorrelating_poses)
        if pair
    ]


def _decorrelating_pose(pose: DecorrelatingPose) -> dict[str, Any]:
    return {
        "point": pose.point,
        "axis": pose.axis,
        "angle_deg": pose.degrees,
        "pose": _pose(pose.command),
        "correlation": pose.correlation,
    }


def _accuracy(assessed: Assessment) -> dict[str, Any] | None:
    accuracy = assessed.accuracy
    if accuracy is None:
        return None
    return {
        "task_named": assessed.task_named,
        "before": _errors(accuracy.before),
        "after": _errors(accuracy.after),
        "poses": [_pose(pose) for pose in assessed.task],
        "reachable": accuracy.reachable.tolist(),
    }


def _errors(errors: PoseErrors) -> dict[str, Any]:
    return {
        "position_rms_mm": errors.position_rms_mm,
        "position_largest_mm": errors.position_largest_mm,
        "orientation_rms_deg": errors.orientation_rms_deg,
        "orientation_largest_deg": errors.orientation_largest_deg,
        "position_mm": errors.distances_mm.tolist(),
        "orientation_deg": np.degrees(errors.angles).tolist(),
    }


def _pose(pose: Pose) -> dict[str, float]:
    return dict(zip("xyzabc", pose.as_tuple(), strict=True))


def outcome_line(
    counts: tuple[int, int, int],
    before: DeviationStatistics | None,
    after: DeviationStatistics | None,
    limit_mm: float,
    verdict: Verdict,
) -> str:
    """The one line everywhere: what was used, held-out deviation before and after, the verdict.

    ``counts`` are the numbers of free parameters, of records, and of points.
    """
    parameters, records, points = counts
    what = f"{parameters} parameters, {records} records at {points} points"
    if before is None or after is None:
        return f"{what}; held-out points: {verdict}"
    means = f"{before.mean_mm:.2f} -> {after.mean_mm:.3f} mm"
    return f"{what}; mean deviation at held-out points {means} (limit {limit_mm:g}): {verdict}"
