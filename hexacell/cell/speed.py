"""The section of the cell file on the speed of moves."""

from __future__ import annotations

from pydantic import Field

from hexacell.cell.fields import Positive, Section


class SpeedSettings(Section):
    """The largest speeds of a move; from the stricter of two, each move gets its duration."""

    joint: Positive = Field(100.0, alias="joint_mm_s", description="of any joint variable")
    edge_mm_s: Positive = Field(100.0, description="of the ball and of any joint of the platform")
    joint_at_gauges: Positive = Field(
        25.0,
        alias="joint_at_gauges_mm_s",
        description="of any joint variable, on a move that begins or ends with gauges at the ball",
    )
    edge_at_gauges_mm_s: Positive = Field(
        25.0, description="of the ball and of any joint of the platform, on such a move"
    )
