"""The server of one simulated gauge line, with the timing of a real one."""

from __future__ import annotations

import logging
import os
import queue
import select
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Literal

from drivers.simulated.closeable import Closeable
from drivers.simulated.gauges.device import Indicator, LineDevice
from drivers.simulated.gauges.faults import InjectedGaugeFault, WireFaults, apply_fault
from drivers.simulated.transports.interface import Transport
from drivers.simulated.transports.pty import PtyTransport
from drivers.simulated.transports.tcp import SocketTransport
from hexacell.clock import CellClock

COMMAND_END = b"\r"
COMMAND_LIMIT = 256
JOB_TIMEOUT_S = 5.0

_log = logging.getLogger(__name__)


class GaugeLineServer(Closeable):
    """Serves a device on a transport, from a thread of its own, until it is closed.

    An answer is sent after ``latency_s`` plus the transmission time of request and answer, in seconds
    of the cell's clock. Answers are sent one after another, as on a cable.
    """

    def __init__(
        self,
        device: LineDevice,
        transport: Transport,
        clock: CellClock,
        *,
        latency_s: float,
        baudrate: int | None = None,
        seed: int = 0,
    ) -> None:
        self.device = device
        self.url = transport.url
        self._transport = transport
        self._clock = clock
        self._latency_s = latency_s
        self._byte_s = device.bits_a_byte / (baudrate or device.baudrate)
        self._faults = WireFaults(seed)
        self._received = b""
        self._answers: deque[tuple[float, bytes]] = deque()
        self._jobs: queue.SimpleQueue[tuple[Callable[[], None], Future[None]]] = queue.SimpleQueue()
        self._wake_read, self._wake_write = os.pipe()
        self._stopping = False
        self._thread = threading.Thread(target=self._serve, name=f"gauges on {self.url}")
        self._thread.start()

    def inject(
        self,
        fault: InjectedGaugeFault,
        *,
        channel: int | None = None,
        answers: int | None = None,
        seconds: float = 1.0,
    ) -> None:
        """Inject ``fault`` now.

        Args:
            fault: The fault.
            channel: The channel of the instrument for its faults; the first one by default.
            answers: How many answers a fault of the line affects; None for all until cleared.
            seconds: Delay of late answers, in the cell's time.
        """
        self._run_on_thread(lambda: self._inject(fault, channel, answers, seconds))

    def clear(self, fault: InjectedGaugeFault, *, channel: int | None = None) -> None:
        """Clear a fault: plug the line in, or switch the instrument on again."""
        self._run_on_thread(lambda: self._clear(fault, channel))

    def send_unsolicited(self, data: bytes) -> None:
        """Send ``data`` now without a request, as a data button or a foot switch does."""
        self._run_on_thread(lambda: self._transport.send(data))

    def close(self) -> None:
        """End the thread and close the line; closing twice is harmless."""
        if self._stopping:
            return
        self._stopping = True
        os.write(self._wake_write, b"x")
        self._thread.join()
        self._transport.close()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _run_on_thread(self, job: Callable[[], None]) -> None:
        """Run a job on the thread of the line, which avoids concurrent access."""
        if self._stopping:
            raise RuntimeError(f"{self.url} is closed")
        done: Future[None] = Future()
        self._jobs.put((job, done))
        os.write(self._wake_write, b"x")
        done.result(JOB_TIMEOUT_S)

    def _serve(self) -> None:
        try:
            self._serve_until_stopped()
        except Exception:  # an error of the simulated physics appears as a broken line
            _log.exception("the simulated gauges on %s have failed", self.url)
            self._unplug()

    def _serve_until_stopped(self) -> None:
        while not self._stopping:
            watched = [self._wake_read, *self._transport.descriptors()]
            ready, _, _ = select.select(watched, [], [], self._until_next_answer_s())
            if self._wake_read in ready:
                os.read(self._wake_read, COMMAND_LIMIT)
                self._do_jobs()
            else:
                self._receive(self._transport.receive(ready))
            self._send_due()

    def _do_jobs(self) -> None:
        while not self._jobs.empty():
            job, done = self._jobs.get()
            try:
                job()
            except Exception as error:
                done.set_exception(error)
            else:
                done.set_result(None)

    def _receive(self, data: bytes) -> None:
        *commands, self._received = (self._received + data).split(COMMAND_END)
        self._received = self._received[-COMMAND_LIMIT:]
        for command in commands:
            self._answer(command.strip(b"\n"))

    def _answer(self, command: bytes) -> None:
        answer, delay_s = self._faults.apply(self.device.answer(command))
        wire_s = (len(command) + len(COMMAND_END) + len(answer)) * self._byte_s
        free_at = max([self._clock.now(), *(due for due, _ in self._answers)])
        self._answers.append((free_at + self._latency_s + wire_s + delay_s, answer))

    def _until_next_answer_s(self) -> float | None:
        if not self._answers:
            return None
        return max(0.0, self._clock.real_seconds(self._answers[0][0] - self._clock.now()))

    def _send_due(self) -> None:
        while self._answers and self._answers[0][0] <= self._clock.now():
            self._transport.send(self._answers.popleft()[1])

    def _inject(
        self, fault: InjectedGaugeFault, channel: int | None, answers: int | None, seconds: float
    ) -> None:
        if fault is InjectedGaugeFault.UNPLUGGED:
            self._unplug()
        elif not apply_fault(self._indicator(channel), fault, on=True):
            self._faults.inject(fault, answers=answers, seconds=seconds)

    def _clear(self, fault: InjectedGaugeFault, channel: int | None) -> None:
        if fault is InjectedGaugeFault.UNPLUGGED:
            self._transport.plug_in()
        elif not apply_fault(self._indicator(channel), fault, on=False):
            self._faults.clear(fault)
        elif fault is InjectedGaugeFault.AUTO_OFF:
            self._transport.send(self.device.power_up())

    def _unplug(self) -> None:
        self._received = b""
        self._answers.clear()
        self._transport.unplug()

    def _indicator(self, channel: int | None) -> Indicator:
        return self.device.indicators[min(self.device.indicators) if channel is None else channel]


def serve_gauges(
    device: LineDevice,
    transport: Literal["pty", "socket"],
    clock: CellClock,
    *,
    name: str = "gauge",
    latency_s: float = 0.02,
    baudrate: int | None = None,
    seed: int = 0,
) -> GaugeLineServer:
    """Serve ``device`` at ``url`` until it is closed.

    ``name`` is the name of a pseudo-terminal in its folder.
    """
    line = PtyTransport(name) if transport == "pty" else SocketTransport()
    return GaugeLineServer(device, line, clock, latency_s=latency_s, baudrate=baudrate, seed=seed)
