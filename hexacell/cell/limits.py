"""Sections of the cell file with numbers that measuring depends on: time, noise, tolerances and limits."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from hexacell.cell.fields import Finite, NotNegative, Positive, Section, broken_rule


class TimingSettings(Section):
    """When a reading counts as settled."""

    window_s: Positive = Field(0.6, description="span of readings that must agree")
    interval_s: Positive = Field(0.1, description="time between readings")
    readings: int = Field(5, ge=2, description="smallest number of readings in the window")
    spread_gauge_mm: Positive = Field(0.06, description="largest range of one gauge in the window")
    spread_encoder_mm: Positive = Field(0.06, description="largest range of one slider in the window")
    give_up_s: Positive = Field(20.0, description="longest wait for settled readings")
    move_s: Positive = Field(1.5, description="duration of an ordinary move, for time estimates only")
    clock_factor: Positive = Field(
        1.0, description="simulated cells only: cell seconds per second of real time"
    )


class NoiseSettings(Section):
    """Standard deviations of the numbers of one record."""

    encoder_mm: Positive = Field(0.01, description="of a slider's position")
    gauge_scale: NotNegative = Field(
        0.001, description="relative error of each gauge's scale, one standard deviation"
    )
    gauge_mm: Positive = Field(0.01, description="of a gauge's reading")


class LimitSettings(Section):
    """Limits of every commanded pose."""

    gauge_travel_mm: Positive = Field(5.0, description="largest deviation from the zeroed reference")
    tilt_deg: Positive = Field(45.0, le=80, description="largest tilt of the platform")
    joint_min_mm: Finite = Field(-1000.0, description="smallest joint variable of any leg")
    joint_max_mm: Finite = Field(1000.0, description="largest joint variable of any leg")
    singularity_margin: Positive = Field(
        0.03, description="smallest singular value of the dimensionless pose Jacobian"
    )

    @model_validator(mode="after")
    def _joint_limits_are_ordered(self) -> Self:
        if self.joint_min_mm >= self.joint_max_mm:
            raise broken_rule("joint_min_mm must be below joint_max_mm", "Exchange or correct them")
        return self


class GuardSettings(Section):
    """When motion is stopped; more limits are in [limits] and [acceptance]."""

    stop_file: str | None = Field(
        None, description="while this file exists the robot does not move; relative to the cell file"
    )
    stop_port: str | None = Field(
        None, description="serial port of a stop contact, closed while motion is allowed"
    )
    stop_contact: Literal["dsr", "cts"] = Field(
        "dsr", description="dsr: the contact joins DTR and DSR of stop_port, cts: RTS and CTS"
    )
    stale_s: Positive = Field(
        0.12, description="longest silence of a device while the robot moves, in real time"
    )
    plate_margin_mm: NotNegative = Field(
        0.5, description="added to limits.gauge_travel_mm during a move, when the ball swings"
    )
    following_mm: Positive = Field(
        1.0, description="largest difference of a slider from its commanded position"
    )
    free_disk_mb: NotNegative = Field(50.0, description="least free space for the run folder, MB")
