"""Sections of the cell file that say which devices there are and how to reach them."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from hexacell.cell.base import Finite, NotNegative, Positive, Section, SixNumbers


class GaugeSettings(Section):
    """One dial indicator."""

    name: str = Field(min_length=1, description="what the technician calls it")
    axis: Literal["x", "y", "z"] = Field(description="base axis its plunger moves along")
    sign: Literal[1, -1] = Field(1, description="1: the reading grows when the ball moves along +axis")
    protocol: str = Field(description="sylvac, mux10, cdi, or one that a plug-in adds")
    port: str | None = Field(None, description="device path or pyserial URL; gauges may share one")
    serial: dict[str, Any] = Field(
        default_factory=dict, description="passed to pyserial unchanged, over the protocol's defaults"
    )
    channel: int = Field(1, ge=1, description="input of a multiplexer")
    timeout_s: Positive = Field(0.5, description="longest wait for an answer")
    travel_mm: Positive = Field(12.5, description="the instrument's own measuring range")


class EncoderSettings(Section):
    """The bank of six slider encoders."""

    protocol: str = Field("cia406", description="cia406, or one that a plug-in adds")
    bus: dict[str, Any] | None = Field(None, description="passed to python-can's Bus unchanged")
    nodes: tuple[int, int, int, int, int, int] = Field(
        (1, 2, 3, 4, 5, 6), description="CANopen node ids of legs 1 to 6"
    )
    measuring_step_nm: Positive = Field(1000, description="one count, nm; the device must agree")
    signed: bool = Field(True, description="positions are I32 (linear devices) rather than U32")
    direction: tuple[
        Literal[1, -1], Literal[1, -1], Literal[1, -1], Literal[1, -1], Literal[1, -1], Literal[1, -1]
    ] = Field((1, 1, 1, 1, 1, 1), description="1: counts grow along the rail's +x")
    offset_mm: SixNumbers = Field((0, 0, 0, 0, 0, 0), description="joint variable at count 0, mm")
    serial_numbers: tuple[int, int, int, int, int, int] | None = Field(
        None, description="object 1018h:4 of each node; refused if another device answers"
    )
    timeout_s: Positive = Field(0.5, description="longest wait for a complete round or an SDO answer")
    heartbeat_ms: int = Field(500, ge=0, le=65535, description="producer heartbeat written to the nodes")


class ControllerSettings(Section):
    """The robot's controller and where its geometry is kept."""

    protocol: str = Field("linuxcncrsh", description="linuxcncrsh, or one that a plug-in adds")
    host: str = Field("127.0.0.1")
    port: int | None = Field(None, ge=1, le=65535, description="TCP port")
    connect_password: str = Field("EMC")
    enable_password: str = Field("EMCTOO")
    config: str = Field(description="the file with its geometry, relative to the cell file")
    config_format: str = Field("toml", description="toml, or one that a plug-in adds")
    reload_command: tuple[str, ...] = Field(
        (), description="run with the machine off to make the controller read its config again"
    )
    move_timeout_s: Positive = Field(60.0, description="longest wait for one move")
    position_tolerance_mm: Positive = Field(0.01, description="arrival: largest position difference")
    angle_tolerance_deg: Positive = Field(0.01, description="arrival: largest angle difference")


class TimingSettings(Section):
    """When a reading counts as settled."""

    window_s: Positive = Field(0.6, description="span of readings that must agree")
    interval_s: Positive = Field(0.1, description="time between readings")
    spread_gauge_mm: Positive = Field(0.06, description="largest range of one gauge in the window")
    spread_encoder_mm: Positive = Field(0.06, description="largest range of one slider in the window")
    give_up_s: Positive = Field(20.0, description="longest wait for settled readings")
    clock_factor: Positive = Field(1.0, description="simulated cells only: cell seconds per second on the wall")


class NoiseSettings(Section):
    """What one record's numbers scatter by, one standard deviation."""

    encoder_mm: Positive = Field(0.01)
    gauge_mm: Positive = Field(0.01)


class ToleranceSettings(Section):
    """How far the built robot may be from its drawing: half-widths."""

    S_mm: Positive = Field(7.0, description="every coordinate of a spherical joint")
    B_mm: Positive = Field(7.0, description="every coordinate of a universal joint")
    l_mm: Positive = Field(7.0, description="every leg length")
    ball_mm: NotNegative = Field(0.0, description="the ball's own mounting: an offset common to all B")


class LimitSettings(Section):
    """What no commanded pose may exceed."""

    gauge_travel_mm: Positive = Field(5.0, description="largest deviation from the zeroed reference")
    tilt_deg: Positive = Field(45.0, le=80, description="largest angle from the untilted platform")
    joint_min_mm: Finite = Field(-1000.0)
    joint_max_mm: Finite = Field(1000.0)
    singularity_margin: Positive = Field(
        0.05, description="smallest singular value of the dimensionless pose Jacobian"
    )
