"""Base class of all dial indicators on serial lines: opening, reading twice, checking settings."""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from typing import ClassVar, TypeVar

from drivers.errors import GaugeAtEnd, GaugeSilent, GaugeUnsteady, WrongAnswer, WrongSetting, ZeroVoid
from drivers.gauges import protocol
from drivers.interfaces import DeviceIdentity, GaugeReading
from drivers.serial.opening import adapter_at
from drivers.serial.port import SerialPort
from drivers.serial.received import quoted, what_is_wrong_with
from drivers.serial.request_port import NoAnswer, RequestPort
from drivers.serial.shared_port import SharedSerialPort, SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError, FileError

MAX_READINGS = 12  # enough for an oscillating ball to come to rest
MAX_REQUESTS = 3
MORE_STATES = 2  # the settings are asked for so often again before something is wrong with them
INCH = ("answers in inch", "Press its in/mm key")

Parsed = TypeVar("Parsed")
Stated = TypeVar("Stated")
ErrorT = TypeVar("ErrorT", bound=DeviceError)


class SerialGauge(ABC):
    """A :class:`drivers.interfaces.Gauge` on a serial line; each protocol is a subclass.

    Values are as displayed, mm, in the instrument's own zero and direction. Failures have the meaning
    that :mod:`drivers.errors` gives them; a ``ZeroVoid`` is repeated until the gauge is opened again.

    Attributes:
        spec: the protocol, its line and a typical answer.
        probe: how a search finds such gauges; None if it must not ask: the cell file describes them, or the
            question does something.
        has_channels: several gauges share a port, each with its ``channel``.
        normal_modes: modes, among those that the instrument reports, in which readings are valid.
        value_request: the request for the displayed value.
        terminator: ends an answer.
        verb: what it does with its values: it answers, or sends.
        answer_check: what in the cell file may be wrong where its answers are others.
        silence_check: what may keep it silent, beside its supply, its cable and its port.
        port_factory: makes the line behind its port.
        channel: the input of a shared multiplexer; None if the gauge uses the line alone.
    """

    spec: ClassVar[protocol.ProtocolSpec]
    probe: ClassVar[protocol.Probe | None] = protocol.Probe()
    has_channels: ClassVar[bool] = False
    normal_modes: ClassVar[frozenset[str]] = frozenset()
    value_request: bytes
    terminator: bytes = b"\r"
    verb: str = "answers"
    answer_check: str = "protocol"
    silence_check: str = "protocol"
    port_factory: type[RequestPort] = SerialPort

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        self.settings = settings
        self.channel: int | None = settings.channel if self.has_channels else None
        self.subject = f"gauge {settings.name}"
        self._log = logging.getLogger(f"drivers.gauges.{settings.name}")
        self._ports = ports
        self._port: SharedSerialPort | None = None
        self._session = 0
        self._state: protocol.GaugeState | None = None
        self._void: ZeroVoid | None = None
        self._last_frame = b""
        self._history = protocol.DisplayHistory(settings)

    @property
    def name(self) -> str:
        """Its name in the cell file."""
        return self.settings.name

    @abstractmethod
    def _parse_value(self, frame: bytes) -> protocol.DisplayedValue:
        """The value in the answer; raises FrameRejected or a DeviceError."""

    @abstractmethod
    async def _read_state(self) -> protocol.GaugeState:
        """Query the settings of the instrument."""

    async def open(self) -> DeviceIdentity:
        """Connect, identify, and refuse inches, hold, peak modes, a low battery and other decimals.

        Raises:
            DeviceError: the port or the instrument is absent, or has wrong settings.
            FileError: the settings of the port are refused, or another gauge uses it.
        """
        self._state = self._void = None
        self._history.begin()
        try:
            await self._connect()
            try:
                state = await self._read_state()
            except ZeroVoid:  # the request has switched it on; it is not zeroed yet
                self._void = None
                state = await self._read_state()
            state = await self._confirmed(state)
            if self.settings.resolution_mm is not None:  # its decimals tell inches from millimetres
                with suppress(GaugeAtEnd):
                    await self._read_value()
        except BaseException as error:
            self._log.warning("cannot be opened: %s", error)
            await self.close()
            raise
        self._state = state
        description = state.identification or self.spec.vendors
        self._log.info("opened on port %s: %s", self.settings.port, description)
        adapter = await asyncio.to_thread(adapter_at, self.settings.port or "")
        return DeviceIdentity(self.name, self.spec.protocol, description, port=adapter)

    async def read(self) -> GaugeReading:
        """The displayed value, mm, as soon as consecutive readings agree: two that hardly differ, or three.

        A reading does not count if bytes came after it that nobody asked for: it may have been such bytes.
        """
        self._opened_state()
        readings = [await self._read_value()]
        in_step = readings[:]
        while len(readings) < MAX_READINGS:
            surplus = self._open_port().line.surplus_count
            readings.append(await self._read_value())
            if self._open_port().line.surplus_count != surplus:
                in_step.clear()
            in_step.append(readings[-1])
            if (agreed := self._history.agreed(in_step)) is not None:
                self._history.add(agreed)
                return GaugeReading(agreed.value, agreed.text)
        shown, limit_mm = ", ".join(one.text for one in readings), self._history.agreement_mm
        problem = f"readings do not agree within {limit_mm:g} mm: {shown}"
        raise self._error(GaugeUnsteady, problem, "Wait until it is still; if it is, check its cable")

    async def read_once(self) -> GaugeReading:
        """The value displayed at this moment, mm, from a single query."""
        self._opened_state()
        try:
            shown = self._plausible(await self._ask(self.value_request))
        except protocol.FrameRejected as rejection:
            self._require_silence()
            raise self._rejected([rejection]) from rejection
        return GaugeReading(shown.value, shown.text)

    async def check(self) -> None:
        """Query the settings again; a ``ZeroVoid`` if one has changed since ``open``."""
        before = self._opened_state()
        now = await self._confirmed(await self._read_state(), before)
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
        self._port = self._ports.acquire(
            self.settings.port,
            self.name,
            self._line_settings(),
            channel=self.channel,
            factory=self.port_factory,
        )
        self._session = await self._port.open()
        self._port.take_unsolicited()

    def _line_settings(self) -> dict[str, object]:
        stated = {**self.settings.serial, "settle_s": self.settings.settle_s}
        return {**asdict(self.spec.line), **stated}

    def _described(self, section: Stated | None, problem: str, example: str) -> Stated:
        """The section of the cell file that describes a gauge of this protocol."""
        if section is None:
            raise FileError(problem, subject=self.subject, action=f"Add {example} to the gauge")
        return section

    async def _read_value(self) -> protocol.DisplayedValue:
        return await self._query(self.value_request, self._plausible)

    def _plausible(self, frame: bytes) -> protocol.DisplayedValue:
        """The value in an answer, which is in mm and fits to those before; raises as ``_parse_value``."""
        shown = self._parse_value(frame)
        if not abs(shown.value) < protocol.LARGEST_MM:
            action = "Look at its display, and name in at_end what it sends at an end of its travel"
            error = self._error(WrongAnswer, f"shows {shown.text}, which is no length", action)
            raise protocol.ImplausibleValue(frame, error)
        set_to = None if self._state is None else self._state.unit
        if self._history.is_inch(shown, set_to, self.spec.inch_decimals):
            raise self._error(WrongSetting, *INCH)
        if reason := self._history.other_decimals(shown):
            action = "Press its in/mm key, or correct resolution_mm in the cell file"
            raise protocol.ImplausibleValue(frame, self._error(WrongSetting, reason, action))
        if reason := self._history.beyond_travel(shown):
            action = "Check its cable and its unit; if its zero or preset key was pressed, open it again"
            raise protocol.ImplausibleValue(frame, self._error(WrongAnswer, reason, action))
        self._history.keep_decimals(shown)
        return shown

    async def _query(self, request: bytes, parse: Callable[[bytes], Parsed]) -> Parsed:
        """The parsed answer; the request is repeated if ``parse`` rejects the frame."""
        rejected: list[protocol.FrameRejected] = []
        while len(rejected) < MAX_REQUESTS or self._is_restarting():
            try:
                return parse(await self._ask(request))
            except protocol.FrameRejected as rejection:
                rejected.append(rejection)
                self._require_silence()
        raise self._rejected(rejected)

    async def _optional(self, request: bytes, parse: Callable[[bytes], Parsed | None]) -> Parsed | None:
        """A setting; None if the instrument says twice that it has none, as it does of a damaged request.

        Once it is open, a setting that is gone is a change, for which all of them are asked again.
        """
        setting = await self._query(request, parse)
        return await self._query(request, parse) if setting is None and self._state is None else setting

    async def _ask(self, request: bytes) -> bytes:
        port = self._open_port()
        try:
            self._last_frame = await port.exchange(request, self.terminator, self.settings.timeout_s)
        except NoAnswer as missing:
            is_lone_line_end = bool(missing.beside_echo) and not missing.is_echoed  # the answer was lost
            if missing.beside_echo.strip() or is_lone_line_end:
                raise protocol.FrameRejected(missing.beside_echo) from missing
            self._log.warning("no answer to %r within %g s", request, self.settings.timeout_s)
            raise self._silent(port, is_echoed=missing.is_echoed) from missing
        port.note_answer(self.name)
        return self._last_frame

    def _silent(self, port: SharedSerialPort, *, is_echoed: bool) -> GaugeSilent:
        """The error for a gauge of which nothing came, and what follows from what did."""
        problem = f"does not answer within {self.settings.timeout_s:g} s on port {port.url}"
        others = f"port, serial and {self.silence_check}"
        action = f"Switch it on, check its cable, and {others} in the cell file"
        if other := port.answering_beside(self.name):
            problem += f", while gauge {other} on it does"
            action = "Switch it on, and check its own cable, and its channel or address in the cell file"
        elif is_echoed:
            problem = f"only the echo of the request comes back from port {port.url}"
            action = "Switch the gauge on and check that the cable is not looped"
        elif self._state is not None:
            problem += f", where it did: {quoted(self._last_frame)} came last"
            action = "See that it is on, its cable in place, its plunger off an end, timeout_s long enough"
        else:
            action += "; if it restarts when its port is opened, settle_s there"
        return self._error(GaugeSilent, problem, action)

    def _is_restarting(self) -> bool:
        """Whether it may be: what it sends then, such as a banner, is no answer."""
        return self._state is None and self._open_port().line.settles_for_s() > 0.0

    def _require_silence(self) -> None:
        self._open_port().require_silence()

    def _rejected(self, rejections: Sequence[protocol.FrameRejected]) -> DeviceError:
        """The error for a request whose answers were all rejected: what most of them say.

        A damaged digit looks like another resolution once; an instrument in inches does so each time.
        """
        self._log.warning("rejected: %s", ", ".join(repr(one.frame) for one in rejections))
        implausible = [one for one in rejections if isinstance(one, protocol.ImplausibleValue)]
        if 2 * len(implausible) > len(rejections):
            return implausible[-1].error
        return self._garbled(next(one.frame for one in reversed(rejections) if one not in implausible))

    def _garbled(self, received: bytes) -> DeviceError:
        """The error for repeated answers that are no frames of the protocol."""
        name, came = self.spec.protocol, f"{self.verb} {quoted(received)}"
        usual = f"{name} uses {self.spec.line}"
        if found := what_is_wrong_with(received, self.terminator, usual):
            return self._error(WrongAnswer, f"{came}, {found[0]}", found[1])
        problem = f"{came} where protocol {name} has answers like {self.spec.example!r}"
        action = f"Correct {self.answer_check} or port in the cell file; `hexacell devices` tries all"
        return self._error(WrongAnswer, problem, action)

    async def _confirmed(
        self, state: protocol.GaugeState, before: protocol.GaugeState | None = None
    ) -> protocol.GaugeState:
        """The state, asked again while it is unusable or not as before: a damaged answer is no setting."""
        for _ in range(MORE_STATES):
            if not (self._unusable(state) or (before and state.changes_since(before))):
                break
            state = await self._read_state()
        if error := self._unusable(state):
            raise error
        return state

    def _unusable(self, state: protocol.GaugeState) -> WrongSetting | None:
        """Why readings in these settings are wrong; None if they are right."""
        is_odd_mode = state.mode is not None and state.mode not in self.normal_modes
        checks = (
            (state.unit is protocol.Unit.INCH, *INCH),
            (state.hold, "is on hold, its value is frozen", "Release hold"),
            (is_odd_mode, f"is in mode {state.mode}", "Set it to normal measuring"),
            (state.scaling, "multiplies what it measures", "Switch its ratio off"),
            (state.battery_low, "has a low battery", "Change it, then zero the gauge again"),
        )
        wrong = ((problem, action) for is_wrong, problem, action in checks if is_wrong)
        return next((self._error(WrongSetting, *one) for one in wrong), None)

    def _error(self, kind: type[ErrorT], problem: str, action: str | None = None) -> ErrorT:
        return kind(problem, subject=self.subject, action=action)

    def _voided(self, problem: str) -> ZeroVoid:
        """The error to raise, now and by every later reading until it is opened again."""
        self._log.warning("%s: its zero is void", problem)
        self._void = self._error(ZeroVoid, problem, "Open it again and zero it again")
        return self._void

    def _at_end(self, problem: str) -> GaugeAtEnd:
        return self._error(GaugeAtEnd, problem, "Move the gauge or the ball")

    def _opened_state(self) -> protocol.GaugeState:
        self._open_port()
        if self._state is None:
            raise self._error(DeviceError, "is not open")
        return self._state

    def _open_port(self) -> SharedSerialPort:
        if self._port is None:
            raise self._error(DeviceError, "is not open")
        if self._void is not None:
            raise self._void
        if self._port.line.open_count != self._session:
            raise self._voided("lost its port meanwhile")
        return self._port


class ValueOnlyGauge(SerialGauge):
    """A gauge of which only the displayed value can be asked.

    Its unit, where the value names it, and its decimals are all that can be checked.
    """

    async def _read_state(self) -> protocol.GaugeState:
        try:
            shown = await self._read_value()
        except GaugeAtEnd:
            return protocol.GaugeState()
        return protocol.GaugeState(unit=shown.unit, decimals=shown.decimals)
