"""Serial lines behind coroutines: one owner thread a port, shared by the gauges on it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from drivers.serial.errors import port_closed, settings_rejected
from drivers.serial.port import WORST_LATENCY_S, SerialPort
from drivers.wire_trace import TraceRecorder
from hexacell.errors import FileError

Result = TypeVar("Result")


class SharedSerialPort:
    """A serial port that one thread owns and any coroutine of one event loop may use.

    ``url`` is anything that ``serial.serial_for_url`` takes, ``serial_settings`` go to it unchanged,
    except ``dtr`` and ``rts``, which set those lines, and time-outs, which are this class's own.

    Exchanges run one after the other. A coroutine that is cancelled leaves its exchange to run out
    in the thread before the next one begins, so the line stays in step; one that had not begun never
    does.
    """

    def __init__(
        self,
        url: str,
        *,
        trace: TraceRecorder | None = None,
        worst_latency_s: float = WORST_LATENCY_S,
        **serial_settings: object,
    ) -> None:
        self.url = url
        self._wire = SerialPort(url, serial_settings, trace, worst_latency_s)
        self._owner = ThreadPoolExecutor(1, thread_name_prefix=f"serial {url}")
        self._closed = False

    @property
    def subject(self) -> str:
        """Who is named when the port fails."""
        return self._wire.subject

    @subject.setter
    def subject(self, subject: str) -> None:
        self._wire.subject = subject

    @property
    def open_count(self) -> int:
        """How often the port has been opened: it grows when it was lost and opened again."""
        return self._wire.open_count

    async def open(self) -> int:
        """Open the port unless it is open and alive; the number of its session.

        Raises:
            DeviceError: The port is absent, in use, or refused.
            FileError: The URL or a setting means nothing to pyserial.
        """
        return await self._run(self._wire.open)

    async def exchange(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Send ``request`` and return the first whole frame, ``terminator`` included.

        Leading line ends and an echo of the request are left out.

        Raises:
            NoAnswer: Nothing, or no whole frame, within ``timeout_s``. The next exchange then waits
                until nothing more can come of this one.
            DeviceError: The port was lost, or is closed, or never falls silent.
        """
        return await self._run(partial(self._wire.exchange, request, terminator, timeout_s))

    def require_silence(self) -> None:
        """Have the line fall silent for a moment before the next exchange: the last frame was bad."""
        if not self._closed:
            self._owner.submit(self._wire.require_silence)

    def take_unsolicited(self) -> bytes:
        """What came unasked or too late since this was last called; the latest bytes only."""
        strays = self._wire.unsolicited
        return b"".join(strays.popleft() for _ in range(len(strays)))

    async def close(self) -> None:
        """Close the port and end its thread, at the latest after 200 ms; twice is harmless."""
        if self._closed:
            return
        self._closed = True
        self._wire.closing.set()
        finished = self._owner.submit(self._wire.close)
        self._owner.shutdown(wait=False)
        await asyncio.shield(asyncio.wrap_future(finished))
        self._owner.shutdown()

    async def _run(self, job: Callable[[], Result]) -> Result:
        if self._closed:
            raise port_closed(self.subject, self.url)
        return await asyncio.wrap_future(self._owner.submit(job))


@dataclass(slots=True)
class _Shared:
    """A link, the settings it was made with, and the channel of every gauge that holds it."""

    link: SharedSerialPort
    settings: Mapping[str, object]
    channels: dict[str, int | None] = field(default_factory=dict)

    def name_subject(self) -> None:
        names = sorted(self.channels)
        self.link.subject = f"gauge {names[0]}" if len(names) == 1 else f"gauges {', '.join(names)}"


class SharedSerialPorts:
    """The links of one cell: gauges on one port share one link."""

    def __init__(
        self, *, trace: TraceRecorder | None = None, worst_latency_s: float = WORST_LATENCY_S
    ) -> None:
        self._trace = trace
        self._worst_latency_s = worst_latency_s
        self._shared: dict[str, _Shared] = {}

    def acquire(
        self, url: str, gauge: str, settings: Mapping[str, object], *, channel: int | None = None
    ) -> SharedSerialPort:
        """The link to ``url``, not yet opened if ``gauge`` is the first to ask for it.

        ``channel`` tells gauges that share a multiplexer apart; None means the port is the gauge's
        alone. To be followed by :meth:`release`.

        Raises:
            FileError: Another gauge has the port with other settings, alone, or on this channel.
        """
        shared = self._shared.get(url) or _Shared(self._make(url, settings), settings)
        self._refuse_conflict(url, shared, gauge, settings, channel)
        self._shared[url] = shared
        shared.channels[gauge] = channel
        shared.name_subject()
        return shared.link

    async def release(self, url: str, gauge: str) -> None:
        """Give the link back; the last gauge to do so closes it. Twice is harmless."""
        shared = self._shared.get(url)
        if shared is None or gauge not in shared.channels:
            return
        del shared.channels[gauge]
        if shared.channels:
            shared.name_subject()
        else:
            await self._shared.pop(url).link.close()

    async def close(self) -> None:
        """Close every link, whoever still holds it."""
        links = [shared.link for shared in self._shared.values()]
        self._shared.clear()
        await asyncio.gather(*(link.close() for link in links))

    def _make(self, url: str, settings: Mapping[str, object]) -> SharedSerialPort:
        try:
            return SharedSerialPort(
                url, trace=self._trace, worst_latency_s=self._worst_latency_s, **settings
            )
        except TypeError as error:  # a setting has the name of one of ours
            raise settings_rejected(f"port {url}", url, error) from error

    @staticmethod
    def _refuse_conflict(
        url: str, shared: _Shared, gauge: str, settings: Mapping[str, object], channel: int | None
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
