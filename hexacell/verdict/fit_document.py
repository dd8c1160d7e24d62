"""The JSON document of an identification and of the checks of it (``fit --json``)."""

from dataclasses import asdict
from typing import Any

import numpy as np

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
    found, contradicted = assessed.found, contradicted_points(assessed.points)
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
        "points_predicted": [
            {
                "point": point,
                "probability": test.probability,
                "noise_ratio": test.ratio,
                "agrees": point not in contradicted,
            }
            for point, test in assessed.points.items()
        ],
        "noise": _noise(assessed.noise),
        "measured_noise": assessed.measured_noise and assessed.measured_noise.model_dump(mode="json"),
        "repeatability": _repeatability(assessed),
        "correlated": [
            {
                "parameters": [pair.first, pair.second],
                "correlation": pair.correlation,
                "measure": pose
                and {
                    "point": pose.point,
                    "axis": pose.axis,
                    "angle_deg": pose.degrees,
                    "pose": asdict(pose.command),
                    "correlation": pose.correlation,
                },
            }
            for pair, pose in assessed.correlated
        ],
        "accuracy": _accuracy(assessed),
        "uncertainty": assessed.budget and _budget(assessed.budget, is_evident=assessed.is_evident),
        "refused": assessed.refused,
        "gates": [gate.model_dump() for gate in assessed.gates],
        "possible_causes": [asdict(cause) for cause in assessed.possible_causes],
        "beyond_tolerance": [asdict(violation) for violation in assessed.tolerance_violations],
    }


def _noise(noise: NoiseLevels | None) -> dict[str, Any] | None:
    if noise is None:
        return None
    levels = {
        name: asdict(level) | {"seen": level.is_resolved}
        for name, level in ((f"encoder_{noise.joint_unit}", noise.encoder), ("gauge_mm", noise.gauge))
    }
    return levels | {"correlation": noise.correlation, "told_apart": noise.are_separable}


def _repeatability(assessed: Assessment) -> dict[str, Any] | None:
    if (scatter := assessed.repeatability) is None:
        return None
    more = {"distance_mm": scatter.distance_mm, "recalibrating_helps": not assessed.does_not_repeat}
    return asdict(scatter) | more


def _accuracy(assessed: Assessment) -> dict[str, Any] | None:
    if (accuracy := assessed.accuracy) is None:
        return None
    return {
        "task_named": assessed.task_named,
        "before": _errors(accuracy.before),
        "after": _errors(accuracy.after),
        "poses": [asdict(pose) for pose in assessed.task],
        "reachable": accuracy.reachable.tolist(),
    }


def _budget(budget: UncertaintyBudget, *, is_evident: bool) -> dict[str, Any]:
    figures = {name: getattr(budget, name) for name in ("noise_mm", "systematic_mm", "standard_mm")}
    for name in ("expanded_mm", "expanded_deg"):
        figures[name] = getattr(budget, name) if is_evident else None
    noise_mm, *parts_mm = budget.parts_mm
    lines = [_line(line) | {"part_mm": mm} for line, mm in zip(budget.lines, parts_mm, strict=True)]
    return figures | {"noise_part_mm": noise_mm, "lines": lines}


def _line(line: BudgetLine) -> dict[str, Any]:
    effect, sizes = line.effect, ("through_mm", "direct_mm", "combined_mm", "per_unit_mm")
    return {
        **{name: getattr(effect, name) for name in ("name", "size", "unit", "source")},
        "acts": effect.occurrence.value,
        **{name: getattr(line, name) for name in sizes},
        "visible": line.is_visible,
        "estimated": effect.is_estimated,
        "parameter_columns": line.parameter_columns.T.tolist() if effect.size else [],
    }


def _errors(errors: PoseErrors) -> dict[str, Any]:
    names = ("position_rms_mm", "position_largest_mm", "orientation_rms_deg", "orientation_largest_deg")
    return {
        **{name: getattr(errors, name) for name in names},
        "position_mm": errors.distances_mm.tolist(),
        "orientation_deg": np.degrees(errors.angles).tolist(),
    }
