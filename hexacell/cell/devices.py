"""Sections of the cell file: the devices and their addresses."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from hexacell.addresses import require_serial_port
from hexacell.cell.described_devices import (
    BOOT_S,
    DbcSettings,
    ModbusEncoderSettings,
    ModbusSettings,
    RequestSettings,
    StreamSettings,
    VisaSettings,
)
from hexacell.cell.fields import (
    CertificateSettings,
    InRange,
    Name,
    NotNegative,
    Positive,
    Section,
    SerialPortName,
    Six,
    Text,
    accepted,
    broken_rule,
    key,
)
from hexacell.kinematics.parameters import JointUnit

NodeId = Annotated[int, Field(ge=1, le=127)]
Unsigned = Annotated[int, Field(ge=0, le=2**32 - 1)]
Direction = Literal[1, -1]
LegNumber = Annotated[int, Field(ge=1, le=6)]
NM = 1e-6
"""A nanometre in mm."""


@dataclass(frozen=True, slots=True)
class GaugeAxis:
    """The base axis a gauge measures along, and the direction in which its reading grows.

    A reading is in the instrument's own zero and direction. A coordinate is the same length along
    the base axis: coordinate = sign x reading. Both are mm.

    Attributes:
        index: 0, 1 or 2 for x, y or z.
        sign: 1 where the reading grows along the positive axis, else -1.
    """

    index: int
    sign: int

    def coordinate(self, reading_mm: float) -> float:
        """The coordinate along the base axis that a reading means, from the instrument's zero."""
        return self.sign * reading_mm

    def reading(self, coordinate_mm: float) -> float:
        """What the instrument shows at a coordinate; the inverse of :meth:`coordinate`."""
        return self.sign * coordinate_mm


class GaugeSettings(Section):
    """One dial indicator."""

    name: Name = key(..., "name of the gauge on screens and in reports")
    axis: Literal["x", "y", "z"] = key(..., "base axis along which the gauge's plunger moves")
    sign: Literal[1, -1] = key(1, "1 if the reading grows when the ball moves along +axis, else -1")
    protocol: Text = key(
        ...,
        "protocol of the gauge: sylvac, mux10, cdi and others of docs/drivers.md, or one that a plug-in "
        "adds",
    )
    port: SerialPortName | None = key(
        None, "device path, pyserial URL or VISA resource; gauges may share one"
    )
    serial: dict[str, Any] = key({}, "settings for pyserial in place of the protocol's defaults")
    channel: int = key(1, "input of a multiplexer, from 1; the four digits of a U-WAVE", ge=0, le=9999)
    timeout_s: Positive = key(0.5, "longest wait for an answer, s")
    settle_s: NotNegative = key(
        BOOT_S,
        "how long a device may restart and hear nothing after its port was opened, s: it is asked again",
    )
    delay_s: NotNegative | None = key(
        None,
        "how old a value may be when it comes from a gauge that sends unasked, s; by default 0.5 for "
        "uwave, else 0.1",
    )
    travel_mm: Positive = key(12.5, "measuring range of the instrument, mm")
    resolution_mm: Positive | None = key(
        None, "last digit of the gauge's display, mm; one with others, but for zeros, is not set to mm"
    )
    agreement_mm: Positive | None = key(
        None,
        "largest difference at which three readings in a row agree, mm, where two hardly differ they "
        "count; by default from [noise]",
    )
    middle_mm: InRange | None = key(
        None,
        "reading in the middle of the gauge's travel, mm; without it, the display does not show where "
        "the plunger stands",
    )
    serial_number: Text = key("", "serial number of the instrument, where it does not report it itself")
    request: RequestSettings | None = key(None, "question and answer of a gauge of protocol request")
    stream: StreamSettings | None = key(None, "lines that a gauge of protocol stream sends")
    visa: VisaSettings | None = key(None, "queries of an instrument of protocol visa")
    modbus: ModbusSettings | None = key(None, "registers of a gauge of protocol modbus")
    certificate: CertificateSettings | None = key(None, "certificate of the gauge's calibration")

    @model_validator(mode="after")
    def _a_multiplexer_has_the_channel(self) -> Self:
        if self.protocol == "mux10" and not 1 <= self.channel <= 99:
            raise broken_rule("a multiplexer has channels from 1 to 99", "Correct channel")
        return self

    @property
    def described(self) -> RequestSettings | StreamSettings | VisaSettings | ModbusSettings | None:
        """The section that describes it; None if its driver knows all."""
        return self.request or self.stream or self.visa or self.modbus

    @property
    def place_on_line(self) -> int:
        """What distinguishes it from others on its port: its channel, or the register of its device."""
        return self.channel if self.modbus is None else self.modbus.device << 16 | self.modbus.register_

    @property
    def mounting(self) -> GaugeAxis:
        """The axis and sign as one value."""
        return GaugeAxis("xyz".index(self.axis), self.sign)

    @property
    def middle_coordinate_mm(self) -> float | None:
        """The coordinate along its base axis that it shows in the middle of its travel, if known."""
        return None if self.middle_mm is None else self.mounting.coordinate(self.middle_mm)


OF_CONTROLLER = "controller"
"""The protocol of encoders that are wired to the controller."""


class EncoderSettings(Section, ABC):
    """The bank of joint encoders, but for what a count is; ``unit`` is that of the joint variables."""

    unit: ClassVar[JointUnit]

    protocol: Text = key(
        "cia406", "protocol of the encoders: cia406, controller, dbc, modbus, or one that a plug-in adds"
    )
    bus: dict[str, Any] | None = key(None, "settings for python-can's Bus")
    nodes: Six[NodeId] = key((1, 2, 3, 4, 5, 6), "CANopen node ids of the legs in order, from 1 to 127")
    signed: bool = key(True, "whether positions are I32 (linear devices) rather than U32")
    direction: Six[Direction] = key(
        (1, 1, 1, 1, 1, 1), "sense of each encoder: 1 if counts grow with the joint variable, else -1"
    )
    offset: Six[InRange] = key(
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), "joint variable at count 0", alias="offset_mm"
    )
    serial_numbers: Six[Unsigned] | None = key(
        None, "serial number of each node, object 1018h:4; another device is refused"
    )
    eds: Text | None = key(
        None,
        "EDS file of the devices, relative to the cell file; they must be what it describes, and "
        "settings that differ from it are reported",
    )
    timeout_s: Positive = key(0.5, "longest wait for a complete round or an SDO answer, s")
    heartbeat_ms: int = key(500, "heartbeat period written to the nodes, ms", ge=0, le=65535)
    largest_speed: Positive | None = key(
        None,
        "largest speed of a joint; a faster one between two samples is a jump; by default from [speed]",
        alias="largest_speed_mm_s",
    )
    dbc: DbcSettings | None = key(None, "messages of encoders of protocol dbc")
    modbus: ModbusEncoderSettings | None = key(None, "registers of encoders of protocol modbus")
    certificate: CertificateSettings | None = key(None, "certificate of the calibration of all encoders")

    @field_validator("nodes")
    @classmethod
    def _nodes_differ(cls, nodes: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(nodes)) != len(nodes):
            raise broken_rule("two encoders have the same node id", "Give each leg its own node id")
        return nodes

    @field_validator("bus")
    @classmethod
    def _has_a_channel_that_may_be_opened(cls, bus: dict[str, Any] | None) -> dict[str, Any] | None:
        accepted(str((bus or {}).get("channel", "")), require_serial_port)
        return bus

    @property
    def are_of_controller(self) -> bool:
        """Whether the controller reads them: their driver is given that of the controller."""
        return self.protocol == OF_CONTROLLER

    @property
    def address(self) -> object:
        """The section that says where the encoders are; None if no section does."""
        if self.are_of_controller:
            return self.protocol
        return self.bus if self.modbus is None else self.modbus.port

    @property
    @abstractmethod
    def step(self) -> float:
        """What one count is of the joint variable, in its unit."""


class LinearEncoderSettings(EncoderSettings):
    """The bank of encoders of joints that slide, or of legs."""

    unit: ClassVar[JointUnit] = JointUnit.MM

    measuring_step_nm: Positive = key(1000, "one count, nm, as the device must report it")
    step_object: Literal["any", "6005h", "6501h"] = key(
        "any", "object with the measuring step, where a device has both and they differ"
    )

    @property
    def step(self) -> float:
        """One count, mm."""
        return self.measuring_step_nm * NM


class RotaryEncoderSettings(EncoderSettings):
    """The bank of encoders of joints that turn."""

    unit: ClassVar[JointUnit] = JointUnit.DEG

    counts_per_turn: int = key(
        1 << 20, "counts in a turn of the joint, as the device must report them", ge=1, le=0xFFFF_FFFF
    )

    @property
    def step(self) -> float:
        """One count, deg."""
        return 360.0 / self.counts_per_turn


class ThermometerSettings(Section):
    """A thermometer at the machine or in the room; its readings are kept with every record."""

    name: Name = key(..., "place of the thermometer: room, base, platform")
    protocol: Text = key("sysfs", "protocol of the thermometer: sysfs, or one that a plug-in adds")
    path: Text = key(
        ...,
        "sysfs: the file with the temperature in millidegrees, such as "
        "/sys/bus/w1/devices/28-.../temperature; simulated: one on the simulated machine",
        min_length=1,
    )
    legs: tuple[LegNumber, ...] = key(
        (), "legs that the thermometer is on, from 1: their expansion is no drift", max_length=6
    )
    part: Literal["base"] | None = key(
        None, "base: it is on the base with its scales, in relation to which legs then expand"
    )
    timeout_s: Positive = key(2.0, "longest wait for a reading, s")
