"""Serial ports as coroutines: one worker thread a port, shared by the gauges on it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from drivers.serial.port import WORST_LATENCY_S, SerialPort
from drivers.wire_trace import TraceRecorder
from hexacell.errors import FileError

Result = TypeVar("Result")


class SharedSerialPort:
    """A serial port used by one thread, on behalf of any coroutine of one event loop.

    ``url`` and ``settings`` are passed to ``serial.serial_for_url``, except ``dtr`` and ``rts``,
    which set those lines. Time-outs are set by this class.

    Exchanges run one after another. If a coroutine is cancelled, its exchange still ends in the thread
    before the next one begins, so the line stays synchronized; a waiting exchange is dropped.
    """

    def __init__(
        self,
        url: str,
        settings: Mapping[str, object],
        trace: TraceRecorder | None = None,
        worst_latency_s: float = WORST_LATENCY_S,
    ) -> None:
        self.url = url
        self._port = SerialPort(url, settings, trace, worst_latency_s)
        self._worker = ThreadPoolExecutor(1, thread_name_prefix=f"serial {url}")
        self._closed = False

    @property
    def subject(self) -> str:
        """The subject of error messages."""
        return self._port.subject

    @subject.setter
    def subject(self, subject: str) -> None:
        self._port.subject = subject

    @property
    def open_count(self) -> int:
        """How often the port has been opened; it grows with every reconnection."""
        return self._port.open_count

    async def open(self) -> int:
        """Open the port unless it is open and usable; how often it has been opened.

        Raises:
            DeviceError: The port is absent, in use, or refused.
            FileError: pyserial does not accept the URL or a setting.
        """
        return await self._run(self._port.open)

    async def exchange(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Send ``request`` and return the first complete frame, ``terminator`` included.

        Leading line ends and an echo of the request are removed.

        Raises:
            NoAnswer: No complete frame within ``timeout_s``. The next exchange then waits until no
                late response can come.
            DeviceError: The port was lost or is closed, or the device sends continuously.
        """
        return await self._run(partial(self._port.exchange, request, terminator, timeout_s))

    def require_silence(self) -> None:
        """Wait for a short silence before the next exchange, after a garbled frame."""
        if not self._closed:
            self._worker.submit(self._port.require_silence)

    def take_unsolicited(self) -> bytes:
        """The bytes that came without a request or too late since the last call; the latest ones only."""
        unsolicited = self._port.unsolicited
        return b"".join(unsolicited.popleft() for _ in range(len(unsolicited)))

    async def close(self) -> None:
        """Close the port and end its thread within 200 ms; closing twice is harmless."""
        if self._closed:
            return
        self._closed = True
        self._port.closing.set()
        finished = self._worker.submit(self._port.close)
        self._worker.shutdown(wait=False)
        await asyncio.shield(asyncio.wrap_future(finished))
        self._worker.shutdown()

    async def _run(self, job: Callable[[], Result]) -> Result:
        self._port.require_not_closed()
        return await asyncio.wrap_future(self._worker.submit(job))


@dataclass(slots=True)
class _PortUsers:
    """A port, its settings, and the channel of every gauge that uses it."""

    port: SharedSerialPort
    settings: Mapping[str, object]
    channels: dict[str, int | None] = field(default_factory=dict)

    def name_subject(self) -> None:
        names = sorted(self.channels)
        self.port.subject = f"gauge {names[0]}" if len(names) == 1 else f"gauges {', '.join(names)}"


class SharedSerialPorts:
    """The serial ports of one cell; gauges behind one multiplexer share a port."""

    def __init__(
        self, *, trace: TraceRecorder | None = None, worst_latency_s: float = WORST_LATENCY_S
    ) -> None:
        self._trace = trace
        self._worst_latency_s = worst_latency_s
        self._shared: dict[str, _PortUsers] = {}

    def acquire(
        self, url: str, gauge: str, settings: Mapping[str, object], *, channel: int | None = None
    ) -> SharedSerialPort:
        """The port at ``url``, not opened yet if ``gauge`` is the first one to use it.

        ``channel`` is the gauge's input of a multiplexer; None if the gauge uses the port alone. Must be
        followed by :meth:`release`.

        Raises:
            FileError: Another gauge uses the port with other settings, alone, or on this channel.
        """
        shared = self._shared.get(url) or _PortUsers(
            SharedSerialPort(url, settings, self._trace, self._worst_latency_s), settings
        )
        self._require_no_conflict(url, shared, gauge, settings, channel)
        self._shared[url] = shared
        shared.channels[gauge] = channel
        shared.name_subject()
        return shared.port

    async def release(self, url: str, gauge: str) -> None:
        """Stop using the port; the last gauge closes it. Releasing twice is harmless."""
        shared = self._shared.get(url)
        if shared is None or gauge not in shared.channels:
            return
        del shared.channels[gauge]
        if shared.channels:
            shared.name_subject()
        else:
            await self._shared.pop(url).port.close()

    async def close(self) -> None:
        """Close every port, used or not."""
        ports = [shared.port for shared in self._shared.values()]
        self._shared.clear()
        await asyncio.gather(*(port.close() for port in ports))

    @staticmethod
    def _require_no_conflict(
        url: str, shared: _PortUsers, gauge: str, settings: Mapping[str, object], channel: int | None
    ) -> None:
        others = {name: taken for name, taken in shared.channels.items() if name != gauge}
        if not others:
            return
        same = [name for name, taken in others.items() if channel is None or taken in {None, channel}]
        problem = None
        if same:
            where = "" if channel is None else f", channel {channel},"
            problem = f"port {url}{where} already belongs to gauge {same[0]}"
        elif dict(settings) != dict(shared.settings):
            problem = f"port {url} is shared with gauge {min(others)} under other serial settings"
        if problem is not None:
            action = "Correct port, channel or serial in the cell file"
            raise FileError(problem, subject=f"gauge {gauge}", action=action)
