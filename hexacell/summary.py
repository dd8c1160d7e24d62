"""What an identification says, for programs (the ``fit --json`` document) and in one line."""

from __future__ import annotations

from typing import Any

from hexacell.geometry import Geometry
from hexacell.identification.result import Identification
from hexacell.verification import Spread, Verdict


def geometry_values(geometry: Geometry) -> dict[str, Any]:
    """``{"S": [6x3], "B": [6x3], "l": [6]}``, mm."""
    return {"S": geometry.S.tolist(), "B": geometry.B.tolist(), "l": geometry.l.tolist()}


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
        "geometry": geometry_values(found.geometry),
        "sigma": geometry_values(Geometry.from_vector(found.sigma)),
        "covariance": found.covariance.tolist(),
        "undetermined": list(found.undetermined),
        "outliers": [
            {"point": outlier.point, "orientation": outlier.orientation} for outlier in found.outliers
        ],
        "frame": found.frame,
    }


def outcome_line(
    found: Identification, before: Spread | None, after: Spread | None, limit_mm: float, verdict: Verdict
) -> str:
    """The one line everywhere: what was used, held-out deviation before and after, the verdict."""
    what = f"{len(found.free)} parameters, {found.records} records at {found.points} points"
    if before is None or after is None:
        return f"{what}; held-out points: {verdict}"
    means = f"{before.mean_mm:.2f} -> {after.mean_mm:.3f} mm"
    return f"{what}; mean deviation at held-out points {means} (limit {limit_mm:g}): {verdict}"
