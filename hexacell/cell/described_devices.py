"""Sections of the cell file that describe what a device sends, where no driver knows it."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from hexacell.cell.fields import NotNegative, Positive, Section, Text, broken_rule

NUMBER = re.compile(  # a number as instruments send it
    r"[+-]?\d+(\.\d*)?"
)

DESCRIBED_GAUGES = frozenset({"request", "stream", "visa", "modbus"})
"""Protocols of gauges that a section of the cell file describes, of the same name."""

Wire = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[\x00-\xff]*$")]
"""Text on a line, one byte a character, which may be control characters."""


class DescribedFrame(Section):
    """What a gauge sends: its pattern, and what its number is."""

    answer: Text = Field(
        min_length=1,
        description="regular expression of what the gauge sends, without line ends; the group "
        "called number, or "
        "the first group, is the number",
    )
    example: Wire = Field(description="typical text that the gauge sends, which answer must match")
    mm_per_unit: Positive = Field(1.0, description="one unit of the number, mm: 25.4 for inches")
    at_end: Wire | None = Field(
        None, description="regular expression of the answer with the plunger at an end of its travel"
    )

    @model_validator(mode="after")
    def _the_example_matches(self) -> Self:
        patterns = [self.answer] + ([] if self.at_end is None else [self.at_end])
        for pattern in patterns:
            try:
                re.compile(pattern)
            except re.error as error:
                raise broken_rule(f"{pattern!r} is no regular expression: {error}", "Correct it") from error
        match = re.fullmatch(self.answer, self.example.strip("\r\n"))
        number = match[self.number_group] if match is not None and match.groups() else None
        if not NUMBER.fullmatch((number or "").replace(" ", "")):
            raise broken_rule(
                "the example is no answer with a number in group 1", "Correct answer or example"
            )
        return self

    @property
    def number_group(self) -> str | int:
        """The group with the number."""
        return "number" if "number" in re.compile(self.answer).groupindex else 1


class RequestSettings(DescribedFrame):
    """What a gauge of protocol ``request`` is asked, and what it answers."""

    ask: Wire = Field(description="text that is sent to ask for a value")
    ends_with: Wire = Field("\r", description="first character of an answer's line end")


class StreamSettings(DescribedFrame):
    """What a gauge of protocol ``stream`` sends by itself, in lines.

    Of several gauges on one port the pattern has a group ``channel``, which is that of the gauge.
    """

    @model_validator(mode="after")
    def _its_groups_are_told_apart(self) -> Self:
        match = re.fullmatch(self.answer, self.example.strip("\r\n"))
        if match is None or not self.has_channel:
            return self
        if self.number_group != "number" or not (match["channel"] or "").isdecimal():
            raise broken_rule(
                "a pattern with a group channel, of digits, needs a group number",
                "Write (?P<channel>...) and (?P<number>...)",
            )
        return self

    @property
    def has_channel(self) -> bool:
        """Whether its lines name the gauge by its channel."""
        return "channel" in re.compile(self.answer).groupindex


CHANNEL_PLACE = "{channel}"


class VisaSettings(Section):
    """What an instrument of protocol ``visa`` is asked, and how it must be set."""

    ask: Text = Field(
        min_length=1,
        description="SCPI query of the value: MEAS:DIST?, or READ? (@{channel}) where gauges share it",
    )
    mm_per_unit: Positive = Field(1.0, description="one unit of the number, mm: 1000 for metres")
    expect: dict[Text, Text] = Field(
        default_factory=dict,
        max_length=20,
        description='answers that queries of its settings must get: { "UNIT:LENG?" = "M" }',
    )
    identify: bool = Field(True, description="whether the instrument is asked *IDN?")
    backend: Text = Field(
        "@py", description="backend of PyVISA: @py is pure Python, @ivi the library of a maker"
    )

    @property
    def has_channel(self) -> bool:
        """Whether several gauges share the instrument."""
        return CHANNEL_PLACE in self.ask

    def question(self, channel: int) -> str:
        """What is asked for the value of a channel."""
        return self.ask.replace(CHANNEL_PLACE, str(channel))


class ModbusSettings(Section):
    """Where the position of a gauge of protocol ``modbus`` is, and what it is."""

    device: int = Field(1, ge=1, le=247, description="address of the device on the line")
    register_: int = Field(
        alias="register", ge=0, le=65535, description="first register of the number, counted from 0"
    )
    kind: Literal["input", "holding"] = Field(
        "input", description="kind of the registers: input (function 4) or holding (function 3)"
    )
    type: Literal["int16", "uint16", "int32", "uint32", "float32"] = Field(
        "int32", description="type of the number, in one or two registers"
    )
    word_order: Literal["big", "little"] = Field(
        "big", description="order of two registers: big if the first one has the upper half"
    )
    mm_per_unit: Positive = Field(0.001, description="one count, mm")
    at_end: tuple[int, ...] = Field(
        (), max_length=8, description="numbers that mean an end of the travel, or no value"
    )


ModbusAddress = Annotated[int, Field(ge=1, le=247)]
Register = Annotated[int, Field(ge=0, le=65535)]
SixDevices = tuple[ModbusAddress, ModbusAddress, ModbusAddress, ModbusAddress, ModbusAddress, ModbusAddress]
SixRegisters = tuple[Register, Register, Register, Register, Register, Register]


class LatchSettings(Section):
    """What is written to all devices at once for each of them to keep its position of that instant."""

    register_: Register = Field(alias="register", description="register that is written, counted from 0")
    value: int = Field(1, ge=0, le=65535, description="value that is written")
    delay_s: NotNegative = Field(0.005, description="wait before the devices are asked, s")


class ModbusEncoderSettings(Section):
    """Where the positions of encoders of protocol ``modbus`` are; they are counts."""

    port: Text | None = Field(None, description="device path or pyserial URL of the line with all of them")
    serial: dict[str, Any] = Field(
        default_factory=dict, description="settings for pyserial; by default 19200 baud and even parity"
    )
    devices: SixDevices = Field(
        (1, 1, 1, 1, 1, 1),
        description="addresses of the devices with legs 1 to 6; one device may have several legs",
    )
    registers: SixRegisters = Field(
        description="first register of the position of legs 1 to 6, counted from 0"
    )
    kind: Literal["input", "holding"] = Field(
        "input", description="kind of the registers: input (function 4) or holding (function 3)"
    )
    bits: Literal[16, 32] = Field(32, description="bits of a position, in one or two registers")
    word_order: Literal["big", "little"] = Field(
        "big", description="order of two registers: big if the first one has the upper half"
    )
    latch: LatchSettings | None = Field(
        None, description="register that samples several devices at one instant, where they have one"
    )
    invalid: tuple[int, ...] = Field((), max_length=8, description="counts that mean no valid position")

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """Device and first register of legs 1 to 6."""
        return tuple(zip(self.devices, self.registers, strict=True))

    @model_validator(mode="after")
    def _places_differ(self) -> Self:
        words = self.bits // 16
        taken = [(device, first + word) for device, first in self.places for word in range(words)]
        if len(set(taken)) < len(taken):
            raise broken_rule("two encoders share a register", "Give each leg registers of its own")
        return self


MessageSignal = Annotated[str, Field(max_length=200, pattern=r"^\w+\.\w+$")]


class DbcSettings(Section):
    """Encoders that send what a DBC file describes."""

    file: Text = Field(min_length=1, description="DBC file, relative to the cell file")
    signals: tuple[
        MessageSignal, MessageSignal, MessageSignal, MessageSignal, MessageSignal, MessageSignal
    ] = Field(
        description="signals with the positions of legs 1 to 6, as Message.Signal; their unit "
        "is that of the DBC "
        "file"
    )
    request: str | None = Field(
        None,
        pattern=r"^[0-9A-Fa-f]{3}#([0-9A-Fa-f]{2}){0,8}$",
        description="frame that asks all encoders, as candump has it: 080#; without it they send unasked",
    )
    delay_s: NotNegative = Field(0.005, description="how old a position may be that comes unasked, s")
    window_s: Positive = Field(0.02, description="longest time between the six positions of a sample, s")
    must_be: dict[Text, int] = Field(
        default_factory=dict,
        max_length=20,
        description="signals of these messages and the values that they have where a position "
        "is valid: { Error ="
        " 0 }",
    )
