"""Base class of all dial indicators on serial lines: opening, reading twice, checking settings."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict
from typing import ClassVar, TypeVar

from drivers.errors import GaugeAtEnd, GaugeUnsteady, WrongSetting, ZeroVoid
from drivers.gauges.protocol import (
    TERMINATOR,
    DisplayedValue,
    FrameRejected,
    GaugeState,
    ProtocolSpec,
    Unit,
    silent_gauge,
    unexpected_answer,
)
from drivers.interfaces import DeviceIdentity, GaugeReading
from drivers.serial.port import NoAnswer
from drivers.serial.shared_port import SharedSerialPort, SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError, FileError

AGREEMENT_MM = 0.05  # consecutive readings closer than this agree; a garbled digit differs by more
MAX_READINGS = 12  # enough for an oscillating ball to come to rest
MAX_REQUESTS = 3

Parsed = TypeVar("Parsed")


class SerialGauge(ABC):
    """A :class:`drivers.interfaces.Gauge` on a serial line; each protocol is a subclass.

    Values are as displayed, mm, in the instrument's own zero and direction. Failures have the meaning
    that :mod:`drivers.errors` gives them; a ``ZeroVoid`` is repeated until the gauge is opened again.

    Attributes:
        value_request: the request for the displayed value.
        channel: the input of a shared multiplexer; None if the gauge uses the line alone.
    """

    spec: ClassVar[ProtocolSpec]
    normal_modes: ClassVar[frozenset[str]] = frozenset()
    value_request: bytes

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        self.settings = settings
        self.channel: int | None = None
        self.subject = f"gauge {settings.name}"
        self._ports = ports
        self._port: SharedSerialPort | None = None
        self._session = 0
        self._state: GaugeState | None = None
        self._void: ZeroVoid | None = None

    @property
    def name(self) -> str:
        """Its name in the cell file."""
        return self.settings.name

    @abstractmethod
    def _parse_value(self, frame: bytes) -> DisplayedValue:
        """The value in the answer; raises FrameRejected or a DeviceError."""

    @abstractmethod
    async def _read_state(self) -> GaugeState:
        """Query the settings of the instrument."""

    async def open(self) -> DeviceIdentity:
        """Connect, identify, and refuse inches, hold, peak modes and a low battery.

        Raises:
            DeviceError: The port or the instrument is absent, or has wrong settings.
            FileError: The settings of the port are refused, or another gauge uses it.
        """
        self._state = self._void = None
        try:
            await self._connect()
            state = await self._read_state_when_awake()
            self._require_usable(state)
        except BaseException:
            await self.close()
            raise
        self._state = state
        description = state.identification or self.spec.vendors
        return DeviceIdentity(self.name, self.spec.protocol, description)

    async def read(self) -> GaugeReading:
        """The displayed value, mm, as soon as two consecutive readings agree."""
        self._opened_state()
        readings = [self._in_mm(await self._read_value())]
        while len(readings) < MAX_READINGS:
            readings.append(self._in_mm(await self._read_value()))
            if abs(readings[-1].value_mm - readings[-2].value_mm) <= AGREEMENT_MM:
                return readings[-1]
        raise GaugeUnsteady(
            f"readings do not agree: {', '.join(reading.raw for reading in readings)}",
            subject=self.subject,
            action="Wait until it is still; if it is, check its cable",
        )

    async def read_once(self) -> GaugeReading:
        """The value displayed at this moment, mm, from a single query."""
        self._opened_state()
        try:
            return self._in_mm(self._parse_value(await self._ask(self.value_request)))
        except FrameRejected as rejection:
            self._require_silence()
            raise unexpected_answer(self.subject, self.spec, rejection.frame) from rejection

    async def check(self) -> None:
        """Query the settings again; a ``ZeroVoid`` if one has changed since ``open``."""
        before = self._opened_state()
        now = await self._read_state()
        self._require_usable(now)
        if changes := now.changes_since(before):
            raise self._voided(f"was set differently: {', '.join(changes)}")

    async def close(self) -> None:
        """Release the port; closing twice is harmless."""
        port, self._port, self._state = self._port, None, None
        if port is not None:
            await self._ports.release(port.url, self.name)

    async def _connect(self) -> None:
        if self.settings.port is None:
            raise FileError("has no port", subject=self.subject, action="Name it in the cell file")
        serial = {**asdict(self.spec.line), **self.settings.serial}
        port = self._ports.acquire(self.settings.port, self.name, serial, channel=self.channel)
        self._port = port
        self._session = await port.open()
        port.take_unsolicited()

    async def _read_state_when_awake(self) -> GaugeState:
        try:
            return await self._read_state()
        except ZeroVoid:  # the request has switched it on; it is not zeroed yet
            self._void = None
            return await self._read_state()

    async def _read_value(self) -> DisplayedValue:
        return await self._query(self.value_request, self._parse_value)

    async def _query(self, request: bytes, parse: Callable[[bytes], Parsed]) -> Parsed:
        """The parsed answer; the request is repeated if ``parse`` rejects the frame."""
        received = b""
        for _ in range(MAX_REQUESTS):
            try:
                return parse(await self._ask(request))
            except FrameRejected as rejection:
                received = rejection.frame
                self._require_silence()
        raise self._garbled(received)

    async def _ask(self, request: bytes) -> bytes:
        port = self._open_port()
        try:
            return await port.exchange(request, TERMINATOR, self.settings.timeout_s)
        except NoAnswer as missing:
            if other_bytes := missing.received.replace(request, b"").strip():
                raise FrameRejected(other_bytes) from missing
            echo = bool(missing.received)
            raise silent_gauge(self.subject, port.url, self.settings.timeout_s, echo=echo) from missing

    def _require_silence(self) -> None:
        self._open_port().require_silence()

    def _garbled(self, received: bytes) -> DeviceError:
        return unexpected_answer(self.subject, self.spec, received)

    def _in_mm(self, displayed: DisplayedValue) -> GaugeReading:
        if displayed.apparent_unit is Unit.INCH:
            raise self._inch()
        return GaugeReading(displayed.value, displayed.text)

    def _require_usable(self, state: GaugeState) -> None:
        if state.unit is Unit.INCH:
            raise self._inch()
        if state.hold:
            raise self._wrong_setting("is on hold, its value is frozen", "Release hold")
        if state.mode is not None and state.mode not in self.normal_modes:
            raise self._wrong_setting(f"is in mode {state.mode}", "Set it to normal measuring")
        if state.scaling:
            raise self._wrong_setting("multiplies what it measures", "Switch its ratio off")
        if state.battery_low:
            raise self._wrong_setting("has a low battery", "Change it, then zero the gauge again")

    def _inch(self) -> WrongSetting:
        return self._wrong_setting("answers in inch", "Press its in/mm key")

    def _wrong_setting(self, problem: str, action: str) -> WrongSetting:
        return WrongSetting(problem, subject=self.subject, action=action)

    def _voided(self, problem: str) -> ZeroVoid:
        """The error to raise, now and by every later reading until it is opened again."""
        self._void = ZeroVoid(problem, subject=self.subject, action="Open it again and zero it again")
        return self._void

    def _at_end(self, problem: str) -> GaugeAtEnd:
        return GaugeAtEnd(problem, subject=self.subject, action="Move the gauge or the ball")

    def _opened_state(self) -> GaugeState:
        self._open_port()
        if self._state is None:
            raise DeviceError("is not open", subject=self.subject)
        return self._state

    def _open_port(self) -> SharedSerialPort:
        if self._port is None:
            raise DeviceError("is not open", subject=self.subject)
        if self._void is not None:
            raise self._void
        if self._port.open_count != self._session:
            raise self._voided("lost its port meanwhile")
        return self._port
