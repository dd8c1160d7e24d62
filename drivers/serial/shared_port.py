"""Serial ports as coroutines: one worker thread a port, shared by the gauges on it."""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from drivers.serial.port import SerialPort
from drivers.serial.request_port import WORST_LATENCY_S, RequestPort
from drivers.wire_trace import TraceRecorder
from drivers.worker_thread import Result, WorkerThread
from hexacell.errors import FileError

RECENT_S = 10.0
"""An answer that came within this time, s, shows that the line is sound."""


class SharedSerialPort:
    """A serial port used by one thread, on behalf of any coroutine of one event loop.

    ``url`` and ``settings`` are passed to ``serial.serial_for_url``, except ``dtr`` and ``rts``,
    which set those lines. Time-outs are set by this class.

    Exchanges run one after another. If a coroutine is cancelled, its exchange still ends in the thread
    before the next one begins, so the line stays synchronized; a waiting exchange is dropped. ``line`` is
    the port itself.
    """

    def __init__(
        self,
        url: str,
        settings: Mapping[str, object],
        trace: TraceRecorder | None = None,
        worst_latency_s: float = WORST_LATENCY_S,
        factory: type[RequestPort] = SerialPort,
    ) -> None:
        self.url = url
        self._settings = settings
        self._channels: dict[str, int | None] = {}
        self._answered_s: dict[str, float] = {}
        self._worker = WorkerThread(f"serial {url}")
        self.line = factory(url, settings, self._worker.closing, trace, worst_latency_s)

    def add_gauge(self, gauge: str, settings: Mapping[str, object], channel: int | None) -> None:
        """Let ``gauge`` use the port, alone or with a multiplexer's ``channel``.

        Raises:
            FileError: Another gauge uses it with other settings, alone, or on this channel.
        """
        others = {name: taken for name, taken in self._channels.items() if name != gauge}
        same = [name for name, taken in others.items() if channel is None or taken in {None, channel}]
        problem = ""
        if same:
            where = "" if channel is None else f", channel {channel},"
            problem = f"port {self.url}{where} already belongs to gauge {same[0]}"
        elif others and dict(settings) != dict(self._settings):
            problem = f"port {self.url} is shared with gauge {min(others)} under other serial settings"
        if problem:
            action = "Correct port, channel or serial in the cell file"
            raise FileError(problem, subject=f"gauge {gauge}", action=action)
        self._channels[gauge] = channel
        self._name_subject()

    def remove_gauge(self, gauge: str) -> bool:
        """Stop ``gauge`` from using the port; whether others use it."""
        self._channels.pop(gauge, None)
        if self._channels:
            self._name_subject()
        return bool(self._channels)

    def note_answer(self, gauge: str) -> None:
        """Keep in mind that ``gauge`` answers."""
        self._answered_s[gauge] = self.line.now()

    def answering_beside(self, gauge: str) -> str:
        """Another gauge on this line that answered a moment ago; empty if none did."""
        since_s = self.line.now() - RECENT_S
        return next((name for name, at in self._answered_s.items() if name != gauge and at > since_s), "")

    async def open(self) -> int:
        """Open the port unless it is open and usable; how often it has been opened."""
        return await self._run(self.line.open)

    async def exchange(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Send ``request``; the first complete frame after it, or ``NoAnswer``."""
        return await self._run(partial(self.line.exchange, request, terminator, timeout_s))

    async def listen(self) -> None:
        """Take what comes within one slice of time, unasked, into ``log``."""
        await self._run(self.listened.listen)

    @property
    def listened(self) -> SerialPort:
        """The line as one that can be listened to; others are only asked."""
        if not isinstance(self.line, SerialPort):
            raise TypeError(f"{self.url} is no serial port")
        return self.line

    def require_silence(self) -> None:
        """Wait for a short silence before the next exchange, after a garbled frame."""
        if not self._worker.closing.is_set():
            self._worker.submit(self.line.require_silence)

    def take_unsolicited(self) -> bytes:
        """The bytes that came without a request or too late since the last call; the latest ones only."""
        unsolicited = self.line.unsolicited
        return b"".join(unsolicited.popleft() for _ in range(len(unsolicited)))

    async def close(self) -> None:
        """Close the port and end its thread within 200 ms; closing twice is harmless."""
        await self._worker.finish(self.line.close)

    async def _run(self, job: Callable[[], Result]) -> Result:
        self.line.require_not_closed()
        return await self._worker.run(job)

    def _name_subject(self) -> None:
        names = sorted(self._channels)
        self.line.subject = f"gauge {names[0]}" if len(names) == 1 else f"gauges {', '.join(names)}"


@dataclass(eq=False, kw_only=True)
class SharedSerialPorts:
    """The serial ports of one cell; gauges behind one multiplexer share a port."""

    trace: TraceRecorder | None = None
    worst_latency_s: float = WORST_LATENCY_S
    _ports: dict[str, SharedSerialPort] = field(default_factory=dict)

    def acquire(
        self,
        url: str,
        gauge: str,
        settings: Mapping[str, object],
        *,
        channel: int | None = None,
        factory: type[RequestPort] = SerialPort,
    ) -> SharedSerialPort:
        """The port at ``url``, not opened yet if ``gauge`` is the first one to use it.

        ``channel`` is the gauge's input of a multiplexer; None if the gauge uses the port alone.
        ``factory`` makes the line behind it. Must be followed by :meth:`release`.

        Raises:
            FileError: Another gauge uses the port with other settings, alone, or on this channel.
        """
        port = self._ports.get(url) or SharedSerialPort(
            url, settings, self.trace, self.worst_latency_s, factory
        )
        port.add_gauge(gauge, settings, channel)
        self._ports[url] = port
        return port

    async def release(self, url: str, gauge: str) -> None:
        """Stop using the port; the last gauge closes it. Releasing twice is harmless."""
        port = self._ports.get(url)
        if port is not None and not port.remove_gauge(gauge):
            del self._ports[url]
            await port.close()

    async def close(self) -> None:
        """Close every port, used or not."""
        ports = list(self._ports.values())
        self._ports.clear()
        await asyncio.gather(*(port.close() for port in ports))
