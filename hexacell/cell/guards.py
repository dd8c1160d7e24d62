"""The section of the cell file that says when motion is stopped, and how a person forbids it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hexacell.cell.base import NotNegative, Positive, Section


class GuardSettings(Section):
    """Limits beyond which nothing moves on; most others are in [limits] and [acceptance]."""

    stop_file: str | None = Field(
        None, description="while this file exists nothing moves; relative to the cell file"
    )
    stop_port: str | None = Field(
        None, description="serial port of a stop contact, closed while motion is allowed"
    )
    stop_contact: Literal["dsr", "cts"] = Field(
        "dsr", description="dsr: the contact joins DTR and DSR of stop_port, cts: RTS and CTS"
    )
    stale_s: Positive = Field(
        0.12, description="longest a watched device may stay silent while the robot moves, on the wall"
    )
    plate_margin_mm: NotNegative = Field(
        0.5, description="beyond limits.gauge_travel_mm, for the ball's swing while it moves"
    )
    following_mm: Positive = Field(
        1.0, description="largest difference of a slider from where the controller was told to send it"
    )
    free_disk_mb: NotNegative = Field(50.0, description="least free space where the run is kept, MB")
