"""Sections of the cell file that say which devices there are and how to reach them."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from hexacell.cell.fields import Finite, NotNegative, Positive, Section, SixNumbers, broken_rule

NodeId = Annotated[int, Field(ge=1, le=127)]
Direction = Literal[1, -1]


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
    nodes: tuple[NodeId, NodeId, NodeId, NodeId, NodeId, NodeId] = Field(
        (1, 2, 3, 4, 5, 6), description="CANopen node ids of legs 1 to 6, each from 1 to 127"
    )
    measuring_step_nm: Positive = Field(1000, description="one count, nm; the device must agree")
    signed: bool = Field(True, description="positions are I32 (linear devices) rather than U32")
    direction: tuple[Direction, Direction, Direction, Direction, Direction, Direction] = Field(
        (1, 1, 1, 1, 1, 1), description="1: counts grow along the rail's +x, -1: against it"
    )
    offset_mm: SixNumbers = Field(
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), description="joint variable at count 0, mm"
    )
    serial_numbers: tuple[int, int, int, int, int, int] | None = Field(
        None, description="object 1018h:4 of each node; refused if another device answers"
    )
    timeout_s: Positive = Field(0.5, description="longest wait for a complete round or an SDO answer")
    heartbeat_ms: int = Field(500, ge=0, le=65535, description="producer heartbeat written to the nodes")

    @field_validator("nodes")
    @classmethod
    def _nodes_differ(cls, nodes: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(nodes)) != len(nodes):
            raise broken_rule("two encoders have the same node id", "Give each leg its own node id")
        return nodes


class ControllerSettings(Section):
    """The robot's controller and where its geometry is kept."""

    protocol: str = Field("linuxcncrsh", description="linuxcncrsh, or one that a plug-in adds")
    host: str = Field("127.0.0.1", description="its name or address on the network")
    port: int | None = Field(None, ge=1, le=65535, description="TCP port")
    connect_password: str = Field("EMC", description="linuxcncrsh: asked for on connecting")
    enable_password: str = Field("EMCTOO", description="linuxcncrsh: asked for before it may move")
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
    readings: int = Field(5, ge=2, description="least number of readings in the window")
    spread_gauge_mm: Positive = Field(0.06, description="largest range of one gauge in the window")
    spread_encoder_mm: Positive = Field(0.06, description="largest range of one slider in the window")
    give_up_s: Positive = Field(20.0, description="longest wait for settled readings")
    move_s: Positive = Field(1.5, description="an ordinary move, for estimates of time only")
    clock_factor: Positive = Field(
        1.0, description="simulated cells only: cell seconds per second on the wall"
    )


class NoiseSettings(Section):
    """What one record's numbers scatter by, one standard deviation."""

    encoder_mm: Positive = Field(0.01, description="of a slider's position")
    gauge_scale: NotNegative = Field(
        0.001, description="relative error of each gauge's scale, one standard deviation"
    )
    gauge_mm: Positive = Field(0.01, description="of a gauge's reading")


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
    joint_min_mm: Finite = Field(-1000.0, description="smallest joint variable of any leg")
    joint_max_mm: Finite = Field(1000.0, description="largest joint variable of any leg")
    singularity_margin: Positive = Field(
        0.03, description="smallest singular value of the dimensionless pose Jacobian"
    )

    @model_validator(mode="after")
    def _joint_range_is_a_range(self) -> Self:
        if self.joint_min_mm >= self.joint_max_mm:
            raise broken_rule("joint_min_mm must be below joint_max_mm", "Exchange or correct them")
        return self
