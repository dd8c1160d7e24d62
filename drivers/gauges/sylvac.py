"""Sylvac opto-RS duplex: also Kaefer, Teclock and TESA indicators with that interface.

Line 4800 baud 7E2. ``?`` requests the value: sign or blank, digits, and ``<``, ``=`` or ``>`` while
tolerances are displayed. The unit is not part of it and is requested with ``UNI?``. ``ERR0`` is
overspeed or the sensor, ``ERR1`` an unknown command, ``ERR2`` wrong parity, ``ERR3`` a plunger out of
its range (Sylvac opto-RS instructions; the answers to settings from the Z-Cal, Hi-Cal and S-Mike
manuals). After switching on, the instrument sends its identification without a request.
"""

import re
from dataclasses import dataclass

from drivers.errors import WrongAnswer
from drivers.gauges import protocol
from drivers.gauges.serial_gauge import SerialGauge
from hexacell.errors import DeviceError

VALUE_FRAME = re.compile(rb"([+\- ])(\d{1,5}\.\d{1,6})[<=>]?\r")
POWER_UP = re.compile(rb"(?<![A-Z])[A-Z]{2}\d{2,}[\w.]*\r")  # maker, instrument, options


SENSOR, COMMAND, PARITY, RANGE = ERROR_FRAMES = (b"ERR0\r", b"ERR1\r", b"ERR2\r", b"ERR3\r")


@dataclass(frozen=True, slots=True)
class Query:
    """A setting: its request, and the pattern of its answer with the setting as the only group."""

    command: bytes
    answer: re.Pattern[bytes]

    def parse(self, frame: bytes) -> str | None:
        """The setting in ``frame``; None if the instrument does not know the command.

        Raises:
            FrameRejected: The frame is no answer to this request.
        """
        if frame == COMMAND:
            return None
        match = self.answer.fullmatch(frame)
        if match is None or frame in ERROR_FRAMES:
            raise protocol.FrameRejected(frame)
        return match[1].decode("ascii").strip()


UNIT = Query(b"UNI?\r", re.compile(rb"(?:UNI ?)?(MM|IN)\r"))
IDENTIFICATION = Query(b"ID?\r", re.compile(rb"([A-Z][ -~]{1,31})\r"))
MODE = Query(b"MOD?\r", re.compile(rb"(?:MOD ?)?((?:NOR|MIN|MAX|DEL|TOL|REF)\d?)\r"))
HOLD = Query(b"STO?\r", re.compile(rb"(?:STO ?)?([01])\r"))
DIRECTION = Query(b"CHA?\r", re.compile(rb"(?:CHA ?)?([+-])\r"))
PRESET = Query(b"PRE?\r", re.compile(rb"(?:PRE ?)?([+\- ]?\d{1,5}\.\d{1,6})\r"))
BATTERY = Query(b"BAT?\r", re.compile(rb"(?:BAT ?)?([01])\r"))


class SylvacGauge(SerialGauge):
    """A dial indicator that speaks Sylvac's opto-RS duplex protocol."""

    # duplex cables are powered by DTR high and RTS low
    spec = protocol.ProtocolSpec(
        "sylvac",
        "Sylvac opto-RS indicator",
        protocol.LineSettings(4800, 7, "E", 2, rts=False),
        "+12.345\r",
        5,
    )
    normal_modes = frozenset({"NOR", "REF", "REF1", "REF2"})
    value_request = b"?\r"

    _previous = (b"", b"")

    def _parse_value(self, frame: bytes) -> protocol.DisplayedValue:
        if match := VALUE_FRAME.fullmatch(frame):
            return protocol.DisplayedValue.of(match[1], match[2], frame)
        if frame == RANGE:
            raise self._at_end("plunger at its end (ERR3)")
        if frame == SENSOR:
            raise self._voided("moved too fast or its sensor fails (ERR0)")
        raise protocol.FrameRejected(frame)  # also another error: the request was garbled

    async def _read_state(self) -> protocol.GaugeState:
        unit = await self._setting(UNIT)
        if unit is None:
            raise self._error(DeviceError, "does not report its unit", "Use an indicator that knows UNI?")
        direction = await self._setting(DIRECTION)
        return protocol.GaugeState(
            unit=protocol.Unit.MM if unit == "MM" else protocol.Unit.INCH,
            identification=await self._setting(IDENTIFICATION),
            mode=await self._setting(MODE),
            hold=_flag(await self._setting(HOLD), "1"),
            reversed=_flag(direction, "-"),
            preset=await self._setting(PRESET),
            battery_low=_flag(await self._setting(BATTERY), "0"),
        )

    async def _setting(self, query: Query) -> str | None:
        return await self._optional(query.command, query.parse)

    async def _ask(self, request: bytes) -> bytes:
        before, self._previous = self._previous, (request, b"")
        frame = await super()._ask(request)
        self._previous = (request, frame)
        if before == (IDENTIFICATION.command, frame) and frame not in ERROR_FRAMES:
            raise protocol.FrameRejected(frame)  # the answer before came once more
        unsolicited = self._open_port().take_unsolicited()
        unsolicited += frame if request != IDENTIFICATION.command else b""
        if power_up := POWER_UP.search(unsolicited):
            self._require_silence()
            raise self._voided(f"was switched on again ({power_up[0]!r})")
        return frame

    def _garbled(self, received: bytes) -> DeviceError:
        if received == PARITY:
            action = f"Check parity settings: {self.spec.protocol} uses {self.spec.line}"
            return self._error(WrongAnswer, "receives requests with wrong parity (ERR2)", action)
        if VALUE_FRAME.fullmatch(received):  # never rejected as an answer to the request for one
            action = "Switch its continuous sending off (OUT0)"
            return self._error(WrongAnswer, f"answers a question for a setting with {received!r}", action)
        return super()._garbled(received)


def _flag(setting: str | None, when: str) -> bool | None:
    return None if setting is None else setting == when
