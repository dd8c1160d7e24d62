"""Results in words and tables, for a terminal."""

from __future__ import annotations

from hexacell.geometry import PARAMETER_NAMES, Geometry
from hexacell.identification.result import Identification


def identification_words(found: Identification, drawing: Geometry) -> str:
    """The parameters beside the drawing, and how well the records agree with them."""
    lines = [
        f"{len(found.free)} parameters from {found.records} records at {found.points} points.",
        f"The solver ended because {found.termination.value} ({found.iterations} iterations).",
        f"Residual {found.residual_rms_mm:.4f} mm rms; chi-square {found.chi2:.1f}, expected {found.dof}.",
        "",
        f"{'':4}{'drawing':>10}{'identified':>12}{'change':>9}{'sigma':>8}  mm",
    ]
    rows = zip(PARAMETER_NAMES, drawing.vector(), found.geometry.vector(), found.sigma, strict=True)
    undetermined = set(found.undetermined)
    for name, old, new, sigma in rows:
        if sigma > 0.0:
            remark = "  not determined by these data" if name in undetermined else ""
            lines.append(f"{name:4}{old:10.3f}{new:12.3f}{new - old:+9.3f}{sigma:8.3f}{remark}")
    lines += [f"Left out, does not agree with the others: {_where(found)}"] if found.outliers else []
    return "\n".join(lines)


def _where(found: Identification) -> str:
    return ", ".join(f"point {o.point} orientation {o.orientation}" for o in found.outliers)
