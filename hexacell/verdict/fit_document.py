"""The JSON document of an identification and of the checks of it (``fit --json``)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from hexacell.design.decorrelation import DecorrelatingPose
from hexacell.identification.diagnostics.frame_alignment import PoseErrors
from hexacell.identification.diagnostics.model_tests import contradicted_points
from hexacell.noise.record_noise import NoiseLevels
from hexacell.results.result import IdentificationResult
from hexacell.uncertainty.budget import BudgetLine, UncertaintyBudget
from hexacell.verdict.assessment import Assessment
from hexacell.verdict.decision import Verdict
from hexacell.verdict.findings import findings


def fit_document(assessed: Assessment) -> dict[str, Any]:
    """What ``hexacell fit --json`` prints and ``result.json`` holds (``docs/interface.md``)."""
    found = assessed.found
    return {
        **IdentificationResult.of(found, assessed.zeros).document(found.geometry.parameters),
        "findings": list(findings(assessed)),
        "verdict": Verdict.NOT_EVALUATED.value,  # no held-out records
        "goodness": {
            "expected_chi2": found.goodness.expected,
            "probability": found.goodness.probability,
            "noise_ratio": found.goodness.ratio,
            "agreement": found.goodness.agreement.value,
        },
        "points_predicted": _points(assessed),
        "noise": _noise(assessed.noise),
        "measured_noise": assessed.measured_noise and assessed.measured_noise.model_dump(mode="json"),
        "repeatability": _repeatability(assessed),
        "correlated": [
            {
                "parameters": [pair.first, pair.second],
                "correlation": pair.correlation,
                "measure": pose and _decorrelating_pose(pose),
            }
            for pair, pose in assessed.correlated
        ],
        "accuracy": _accuracy(assessed),
        "uncertainty": assessed.budget and _budget(assessed.budget),
        "refused": assessed.refused,
        "possible_causes": [asdict(cause) for cause in assessed.possible_causes],
        "beyond_tolerance": [asdict(violation) for violation in assessed.tolerance_violations],
    }


def _points(assessed: Assessment) -> list[dict[str, Any]]:
    contradicted = {one.point for one in contradicted_points(assessed.points)}
    return [
        {
            "point": one.point,
            "probability": one.test.probability,
            "noise_ratio": one.test.ratio,
            "agrees": one.point not in contradicted,
        }
        for one in assessed.points
    ]


def _noise(noise: NoiseLevels | None) -> dict[str, Any] | None:
    if noise is None:
        return None
    levels = {
        name: asdict(level) | {"seen": level.is_resolved}
        for name, level in ((f"encoder_{noise.joint_unit}", noise.encoder), ("gauge_mm", noise.gauge))
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


def _decorrelating_pose(pose: DecorrelatingPose) -> dict[str, Any]:
    return {
        "point": pose.point,
        "axis": pose.axis,
        "angle_deg": pose.degrees,
        "pose": asdict(pose.command),
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
        "poses": [asdict(pose) for pose in assessed.task],
        "reachable": accuracy.reachable.tolist(),
    }


def _budget(budget: UncertaintyBudget) -> dict[str, Any]:
    return {
        "noise_mm": budget.noise_mm,
        "systematic_mm": budget.systematic_mm,
        "standard_mm": budget.standard_mm,
        "expanded_mm": budget.expanded_mm,
        "expanded_deg": budget.expanded_deg,
        "lines": [_line(line) for line in budget.lines],
    }


def _line(line: BudgetLine) -> dict[str, Any]:
    effect = line.effect
    return {
        "name": effect.name,
        "size": effect.size,
        "unit": effect.unit,
        "source": effect.source,
        "acts": effect.occurrence.value,
        "through_mm": line.through_mm,
        "direct_mm": line.direct_mm,
        "combined_mm": line.combined_mm,
        "per_unit_mm": line.per_unit_mm,
        "visible": line.is_visible,
        "estimated": effect.is_estimated,
        "parameter_columns": line.parameter_columns.T.tolist() if effect.size else [],
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
