"""The parameters: drawing, identified, change, sigma, and what that means."""

from __future__ import annotations

from hexacell.geometry import PARAMETER_NAMES, Geometry
from hexacell.identification.result import Identification

HEADER = f"{'mm':4}{'drawing':>10}{'identified':>12}{'change':>9}{'sigma':>8}"


def parameter_table(found: Identification, drawing: Geometry) -> str:
    """One line a parameter; those that the choice of frames fixes are left out."""
    undetermined = set(found.undetermined)
    rows = zip(PARAMETER_NAMES, drawing.vector(), found.geometry.vector(), found.sigma, strict=True)
    lines = [
        f"{name:4}{old:10.3f}{new:12.3f}{new - old:+9.3f}{sigma:8.3f}  "
        + ("not determined by these data" if name in undetermined else _moved(new - old, sigma))
        for name, old, new, sigma in rows
        if sigma > 0.0
    ]
    return "\n".join([HEADER, *lines])


def _moved(change: float, sigma: float) -> str:
    times = abs(change) / sigma
    return f"moved {times:.1f} sigma" if times < 99.95 else f"moved {times:.0f} sigma"
