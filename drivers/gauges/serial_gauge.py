"""What all dial indicators on serial lines share: opening, agreed readings, checks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, TypeVar

from drivers.gauges.errors import FrameRejected, GaugeUnsteady, WrongMode, WrongUnit, ZeroVoid
from drivers.gauges.protocol import (
    TERMINATOR,
    DisplayedValue,
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

AGREEMENT_MM = 0.05  # readings in a row closer than this agree: noise, no flipped digit
MAX_READINGS = 12  # enough for a ball that still swings to come to rest
TRIES = 3

Parsed = TypeVar("Parsed")


class SerialGauge(ABC):
    """A :class:`drivers.interfaces.Gauge` on a serial line. A protocol is a subclass.

    Values are what the instrument shows, mm, in its own zero and direction.
    """

    spec: ClassVar[ProtocolSpec]
    normal_modes: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        self.settings = settings
        self.subject = f"gauge {settings.name}"
        self._links = ports
        self._link: SharedSerialPort | None = None
        self._session = 0
        self._state: GaugeState | None = None
        self._void: ZeroVoid | None = None

    @property
    def name(self) -> str:
        """The name the cell file gives it."""
        return self.settings.name

    @property
    def channel(self) -> int | None:
        """Its input of a multiplexer whose line it shares; None if the line is its own."""
        return None

    @property
    @abstractmethod
    def value_request(self) -> bytes:
        """What asks for the value shown."""

    @abstractmethod
    def _understand(self, frame: bytes) -> DisplayedValue:
        """The value in an answer to the question; raises FrameRejected or a DeviceError."""

    @abstractmethod
    async def _inspect(self) -> GaugeState:
        """Ask the instrument what it is set to."""

    async def open(self) -> DeviceIdentity:
        """Connect, identify, and refuse inches, hold, peak modes and a low battery.

        Raises:
            DeviceError: The port or the instrument is absent, wrongly set, or no such instrument.
            FileError: The port's settings are refused, or another gauge has the port.
        """
        self._state = self._void = None
        try:
            await self._connect()
            state = await self._inspect_awake()
            self._refuse(state)
        except BaseException:
            await self.close()
            raise
        self._state = state
        description = state.identification or self.spec.makers
        return DeviceIdentity(self.name, self.spec.protocol, description)

    async def read(self) -> GaugeReading:
        """The value shown, mm, once two readings in a row agree.

        Raises:
            GaugeAtEnd: The plunger is at an end of its travel.
            GaugeUnsteady: No two readings in a row agree.
            ZeroVoid: The instrument or its port was off in between; open it again.
            DeviceError: It is silent, answers nonsense or in inches, or is not open.
        """
        self._opened_state()
        readings = [self._in_mm(await self._shown())]
        while len(readings) < MAX_READINGS:
            readings.append(self._in_mm(await self._shown()))
            if abs(readings[-1].value - readings[-2].value) <= AGREEMENT_MM:
                return GaugeReading(readings[-1].value, readings[-1].text)
        raise GaugeUnsteady(
            f"readings do not agree: {', '.join(shown.text for shown in readings)}",
            subject=self.subject,
            action="Wait until it stands still; if it does, check its cable",
        )

    async def read_once(self) -> GaugeReading:
        """The value shown in this moment, mm, moving or not: one question, no second opinion.

        Raises:
            GaugeAtEnd: The plunger is at an end of its travel.
            WrongAnswer: The answer is garbled.
            DeviceError: As :meth:`read`.
        """
        self._opened_state()
        try:
            shown = self._in_mm(self._understand(await self._ask(self.value_request)))
        except FrameRejected as rejection:
            self._distrust()
            raise unexpected_answer(self.subject, self.spec, rejection.frame) from rejection
        return GaugeReading(shown.value, shown.text)

    async def check(self) -> None:
        """Ask for the settings again and compare them with those found by ``open``.

        Raises:
            ZeroVoid: One of them has changed, or the instrument was off in between.
            DeviceError: It is silent, or now in a unit or mode that falsifies readings.
        """
        before = self._opened_state()
        now = await self._inspect()
        self._refuse(now)
        if changes := now.changes_since(before):
            raise self._voided(f"was set differently: {', '.join(changes)}")

    async def close(self) -> None:
        """Let the line go; closing twice is harmless."""
        link, self._link, self._state = self._link, None, None
        if link is not None:
            await self._links.release(link.url, self.name)

    async def _connect(self) -> None:
        if self.settings.port is None:
            raise FileError("has no port", subject=self.subject, action="Name it in the cell file")
        serial = self.spec.line.overlaid(self.settings.serial)
        link = self._links.acquire(self.settings.port, self.name, serial, channel=self.channel)
        self._link = link
        self._session = await link.open()
        link.take_unsolicited()

    async def _inspect_awake(self) -> GaugeState:
        try:
            return await self._inspect()
        except ZeroVoid:  # our question has switched it on; nothing is zeroed yet
            self._void = None
            return await self._inspect()

    async def _shown(self) -> DisplayedValue:
        return await self._query(self.value_request, self._understand)

    async def _query(self, request: bytes, parse: Callable[[bytes], Parsed]) -> Parsed:
        """What ``parse`` finds in the answer; asked again if it rejects the frame."""
        received = b""
        for _ in range(TRIES):
            try:
                return parse(await self._ask(request))
            except FrameRejected as rejection:
                received = rejection.frame
                self._distrust()
        raise self._nonsense(received)

    async def _ask(self, request: bytes) -> bytes:
        link = self._live_link()
        try:
            return await link.exchange(request, TERMINATOR, self.settings.timeout_s)
        except NoAnswer as missing:
            if beside := missing.received.replace(request, b"").strip():
                raise FrameRejected(beside) from missing
            echo = bool(missing.received)
            raise silent_gauge(self.subject, link.url, self.settings.timeout_s, echo=echo) from missing

    def _distrust(self) -> None:
        self._live_link().require_silence()

    def _nonsense(self, received: bytes) -> DeviceError:
        return unexpected_answer(self.subject, self.spec, received)

    def _in_mm(self, shown: DisplayedValue) -> DisplayedValue:
        if shown.apparent_unit is Unit.INCH:
            raise self._inch()
        return shown

    def _refuse(self, state: GaugeState) -> None:
        if state.unit is Unit.INCH:
            raise self._inch()
        if state.hold:
            raise self._wrong_mode("is on hold, its value is frozen", "Release hold")
        if state.mode is not None and state.mode not in self.normal_modes:
            raise self._wrong_mode(f"is in mode {state.mode}", "Set it to normal measuring")
        if state.scaling:
            raise self._wrong_mode("multiplies what it measures", "Switch its ratio off")
        if state.battery_low:
            raise self._wrong_mode("has a low battery", "Change it, then zero the gauge again")

    def _inch(self) -> WrongUnit:
        return WrongUnit("answers in inch", subject=self.subject, action="Press its in/mm key")

    def _wrong_mode(self, problem: str, action: str) -> WrongMode:
        return WrongMode(problem, subject=self.subject, action=action)

    def _voided(self, problem: str) -> ZeroVoid:
        """The error to raise, now and at every later reading until it is opened again."""
        self._void = ZeroVoid(problem, subject=self.subject, action="Open it again and zero anew")
        return self._void

    def _opened_state(self) -> GaugeState:
        self._live_link()
        if self._state is None:
            raise DeviceError("is not open", subject=self.subject)
        return self._state

    def _live_link(self) -> SharedSerialPort:
        if self._link is None:
            raise DeviceError("is not open", subject=self.subject)
        if self._void is not None:
            raise self._void
        if self._link.open_count != self._session:
            raise self._voided("lost its port in between")
        return self._link
