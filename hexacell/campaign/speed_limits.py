"""The largest speeds of a move, as the cell file states them."""

from __future__ import annotations

from hexacell.cell.speed import SpeedSettings
from hexacell.motion.duration import SpeedLimits


def speed_limits(settings: SpeedSettings, *, at_gauges: bool) -> SpeedLimits:
    """Those of a move that begins or ends with gauges at the ball, or of one without."""
    if at_gauges:
        return SpeedLimits(settings.joint_at_gauges, settings.edge_at_gauges_mm_s)
    return SpeedLimits(settings.joint, settings.edge_mm_s)
