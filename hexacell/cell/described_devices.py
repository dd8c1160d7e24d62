"""Sections of the cell file that describe what a device sends, where no driver knows it."""

import re
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from hexacell.cell.fields import NotNegative, Positive, Section, SerialPortName, Six, Text, broken_rule, key

NUMBER = re.compile(  # a number as instruments send it
    r"[+-]?(\d+\.?\d*|\.\d+)([Ee][+-]?\d{1,2})?"
)

BOOT_S = 2.5
"""Longest restart of usual microcontrollers, from the opening of their port to the first line they hear."""

DESCRIBED_GAUGES = frozenset({"request", "stream", "visa", "modbus"})
"""Protocols of gauges that a section of the cell file describes, of the same name."""

Wire = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[\x00-\xff]*$")]
"""Text on a line, one byte a character, which may be control characters."""


class DescribedFrame(Section):
    """What a gauge sends: its pattern, and what its number is."""

    answer: Text = key(
        ...,
        "regular expression of what the gauge sends, without line ends; the group called number, or the "
        "first group, is the number",
        min_length=1,
    )
    example: Wire = key(..., "typical text that the gauge sends, which answer must match")
    mm_per_unit: Positive = key(1.0, "one unit of the number, mm: 25.4 for inches")
    at_end: Wire | None = key(
        None, "regular expression of the answer with the plunger at an end of its travel"
    )

    @model_validator(mode="after")
    def _the_example_matches(self) -> Self:
        for pattern in [self.answer] + ([] if self.at_end is None else [self.at_end]):
            try:
                re.compile(pattern)
            except re.error as error:
                raise broken_rule(f"{pattern!r} is no regular expression: {error}", "Correct it") from error
        match = re.fullmatch(self.answer, self.bare_example)
        number = match[self.number_group] if match is not None and match.groups() else None
        if not NUMBER.fullmatch((number or "").replace(" ", "")):
            raise broken_rule(
                "the example is no answer with a number in group 1", "Correct answer or example"
            )
        return self

    @property
    def bare_example(self) -> str:
        """The example without what ends it."""
        return self.example.strip("\r\n")

    @property
    def number_group(self) -> str | int:
        """The group with the number."""
        return "number" if "number" in re.compile(self.answer).groupindex else 1


class RequestSettings(DescribedFrame):
    """What a gauge of protocol ``request`` is asked, and what it answers."""

    ask: Wire = key(..., "text that is sent to ask for a value")
    ends_with: Wire = key("\r", "first character of an answer's line end; `ask` has that of the question")


class StreamSettings(DescribedFrame):
    """What a gauge of protocol ``stream`` sends by itself, in lines.

    Of several gauges on one port the pattern has a group ``channel``, which is that of the gauge.
    """

    ends_with: Wire | None = key(None, "what ends each value; by default any line end")

    @property
    def bare_example(self) -> str:
        """The example without what ends it."""
        return super().bare_example.removesuffix(self.ends_with or "")

    @model_validator(mode="after")
    def _its_groups_are_told_apart(self) -> Self:
        match = re.fullmatch(self.answer, self.bare_example)
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

    ask: Text = key(
        ...,
        "SCPI query of the value: MEAS:DIST?, or READ? (@{channel}) where gauges share it",
        min_length=1,
    )
    mm_per_unit: Positive = key(1.0, "one unit of the number, mm: 1000 for metres")
    expect: dict[Text, Text] = key(
        {}, 'answers that queries of its settings must get: { "UNIT:LENG?" = "M" }', max_length=20
    )
    line_end: Wire = key("\n", "end of every query; its last character is that of every answer")
    identify: bool = key(True, "whether the instrument is asked *IDN?")
    backend: Text = key("@py", "backend of PyVISA: @py is pure Python, @ivi the library of a maker")

    @property
    def has_channel(self) -> bool:
        """Whether several gauges share the instrument."""
        return CHANNEL_PLACE in self.ask

    def question(self, channel: int) -> str:
        """What is asked for the value of a channel."""
        return self.ask.replace(CHANNEL_PLACE, str(channel))


ModbusAddress = Annotated[int, Field(ge=1, le=247)]
Register = Annotated[int, Field(ge=0, le=65535)]


class RegisterSettings(Section):
    """How the registers of a Modbus device are read."""

    kind: Literal["input", "holding"] = key(
        "input", "kind of the registers: input (function 4) or holding (function 3)"
    )
    word_order: Literal["big", "little"] = key(
        "big", "order of two registers: big if the first one has the upper half"
    )


class ModbusSettings(RegisterSettings):
    """Where the position of a gauge of protocol ``modbus`` is, and what it is."""

    device: ModbusAddress = key(1, "address of the device on the line")
    register_: Register = key(..., "first register of the number, counted from 0", alias="register")
    type: Literal["int16", "uint16", "int32", "uint32", "float32"] = key(
        "int32", "type of the number, in one or two registers"
    )
    mm_per_unit: Positive = key(0.001, "one count, mm")
    at_end: tuple[int, ...] = key((), "numbers that mean an end of the travel, or no value", max_length=8)


class LatchSettings(Section):
    """What is written to all devices at once for each of them to keep its position of that instant."""

    register_: Register = key(..., "register that is written, counted from 0", alias="register")
    value: int = key(1, "value that is written", ge=0, le=65535)
    delay_s: NotNegative = key(0.005, "wait before the devices are asked, s")


class ModbusEncoderSettings(RegisterSettings):
    """Where the positions of encoders of protocol ``modbus`` are; they are counts."""

    port: SerialPortName | None = key(None, "device path or pyserial URL of the line with all of them")
    serial: dict[str, Any] = key({}, "settings for pyserial; by default 19200 baud and even parity")
    devices: Six[ModbusAddress] = key(
        (1, 1, 1, 1, 1, 1), "addresses of the devices with the legs in order; one may have several legs"
    )
    registers: Six[Register] = key(..., "first register of the position of each leg, counted from 0")
    settle_s: NotNegative = key(BOOT_S, "how long devices may restart after the port was opened, s")
    bits: Literal[16, 32] = key(32, "bits of a position, in one or two registers")
    latch: LatchSettings | None = key(
        None, "register that samples several devices at one instant, where they have one"
    )
    invalid: tuple[int, ...] = key((), "counts that mean no valid position", max_length=8)

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

    file: Text = key(..., "DBC file, relative to the cell file", min_length=1)
    signals: Six[MessageSignal] = key(
        ..., "signals with the positions of the legs, as Message.Signal; their unit is that of the DBC file"
    )
    request: str | None = key(
        None,
        "frame that asks all encoders, as candump has it: 080#; without it they send unasked",
        pattern=r"^[0-9A-Fa-f]{3}#([0-9A-Fa-f]{2}){0,8}$",
    )
    delay_s: NotNegative = key(0.005, "how old a position may be that comes unasked, s")
    window_s: Positive = key(0.02, "longest time between the six positions of a sample, s")
    must_be: dict[Text, int] = key(
        {},
        "signals of these messages and the values that they have where a position is valid: { Error = 0 }",
        max_length=20,
    )
