"""CDI and Starrett indicators with the serial ASCII command protocol.

Line 9600 8N1. ``R`` requests the value: sign, eight characters of digits, point and blanks, ``, ``,
and ``IN`` or ``MM``. ``?pXXX`` requests parameter XXX (Starrett IQ manual, page 17): p011 mode 0 ABS,
1 TIR, 2 INCR; p013 unit 1 in, 2 mm; p019 reversed; p021 hold; p040 ratio. The manual does not show its
answer: the bare number and ``pXXX=number`` are both accepted. Older indicators only know ``R``.
"""

import re
from enum import IntEnum
from functools import partial

from drivers.errors import GaugeAtEnd, GaugeSilent
from drivers.gauges import protocol
from drivers.gauges.serial_gauge import SerialGauge

VALUE_FRAME = re.compile(rb"([+-])(?=.{8}, )( *\d+\.\d+ *), (IN|MM)\r")
PARAMETER = re.compile(rb"(?:[pP](\d{3}) ?= ?)?(\d{1,3})\r")
UNITS = {b"IN": protocol.Unit.INCH, b"MM": protocol.Unit.MM}
UNIT_NUMBERS = {1: protocol.Unit.INCH, 2: protocol.Unit.MM}
MODES = {0: "ABS", 1: "TIR", 2: "INCR"}
OUT_OF_BOUNDS = b"OUT OF BOUNDS\r"
UNKNOWN_PARAMETER = (b"NOT FOUND\r", b"NO ACCESS\r")


class Parameter(IntEnum):
    """The configuration parameters that can make readings wrong."""

    MODE = 11
    UNIT = 13
    REVERSED = 19
    HOLD = 21
    RATIO = 40


def parse_parameter(frame: bytes, parameter: Parameter) -> int | None:
    """The value of ``parameter`` in the answer; None if the instrument has no such parameter.

    Raises:
        FrameRejected: The frame is something else, or names another parameter.
    """
    if frame in UNKNOWN_PARAMETER:
        return None
    match = PARAMETER.fullmatch(frame)
    if match is None or int(match[1] or parameter) != parameter:
        raise protocol.FrameRejected(frame)
    return int(match[2])


class CdiGauge(SerialGauge):
    """A CDI or Starrett dial indicator."""

    spec = protocol.ProtocolSpec(
        "cdi", "CDI or Starrett indicator", protocol.LineSettings(9600), "+  2.1380, MM\r\n"
    )
    normal_modes = frozenset({"ABS", "INCR"})
    value_request = b"R\r"

    _knows_parameters: bool | None = None

    def _parse_value(self, frame: bytes) -> protocol.DisplayedValue:
        if match := VALUE_FRAME.fullmatch(frame):
            return protocol.DisplayedValue.of(match[1], match[2], frame, UNITS[match[3]])
        if frame == OUT_OF_BOUNDS:
            raise self._at_end("plunger at its end (OUT OF BOUNDS)")
        raise protocol.FrameRejected(frame)  # also another error: the request was garbled

    async def _read_state(self) -> protocol.GaugeState:
        try:
            unit: protocol.Unit | None = (await self._read_value()).unit
        except GaugeAtEnd:
            unit = UNIT_NUMBERS.get(await self._parameter(Parameter.UNIT) or 0)
        mode = await self._parameter(Parameter.MODE)
        return protocol.GaugeState(
            unit=unit,
            mode=None if mode is None else MODES.get(mode, str(mode)),
            reversed=_flag(await self._parameter(Parameter.REVERSED)),
            hold=_flag(await self._parameter(Parameter.HOLD)),
            scaling=_flag(await self._parameter(Parameter.RATIO)),
        )

    async def _parameter(self, parameter: Parameter) -> int | None:
        """Its value; None if the instrument does not have it, or knows no parameters at all."""
        if self._knows_parameters is False:
            return None
        for _ in range(2):  # the answer to one may have been lost
            try:
                value = await self._optional(
                    b"?p%03d\r" % parameter, partial(parse_parameter, parameter=parameter)
                )
            except GaugeSilent:
                if self._knows_parameters:
                    raise
            else:
                self._knows_parameters = True
                return value
        self._knows_parameters = False
        return None


def _flag(number: int | None) -> bool | None:
    return None if number is None else number != 0
