"""The simulated wire: one thread that takes frames in, keeps timers, and sends frames out."""

from __future__ import annotations

import heapq
import itertools
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import can
import canopen

_log = logging.getLogger(__name__)

SLICE_S = 0.02
"""Longest wait for a frame; a timer set by another thread may be so late."""


@dataclass(order=True, slots=True)
class Timer:
    """Something to be done at a time; ``cancel`` it as long as it has not been."""

    due: float
    sequence: int
    action: Callable[[], None] = field(compare=False)
    cancelled: bool = field(default=False, compare=False)

    def cancel(self) -> None:
        """Keep it from happening."""
        self.cancelled = True


class SimulatedCanBus(canopen.Network):
    """A CANopen network for simulated nodes on python-can's ``virtual`` interface.

    Everything that nodes do happens with ``lock`` held, on the line's own thread or on that of
    whoever injects a fault.
    """

    def __init__(self, channel: str) -> None:
        # A bounded receive queue would make senders on this interface block for ever.
        super().__init__(can.Bus(channel, interface="virtual"))
        self.lock = threading.RLock()
        self._timers: list[Timer] = []
        self._sequence = itertools.count()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="simulated encoders", daemon=True)

    def start(self) -> None:
        """Begin to take frames in."""
        self._thread.start()

    def stop(self) -> None:
        """Fall silent for good; doing it twice is harmless."""
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def close(self) -> None:
        """Stop, and let the channel go."""
        self.stop()
        if self.bus is not None:
            self.bus.shutdown()

    def call_later(self, seconds: float, action: Callable[[], None]) -> Timer:
        """Do ``action`` after so many seconds on the wall."""
        timer = Timer(time.monotonic() + seconds, next(self._sequence), action)
        with self.lock:
            heapq.heappush(self._timers, timer)
        return timer

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send one frame, unless the line has fallen silent."""
        if not self._stopping.is_set():
            super().send_message(can_id, data, remote)

    def send_periodic(  # type: ignore[override]
        self,
        can_id: int,
        data: bytes,
        period: float,
        remote: bool = False,  # noqa: ARG002
    ) -> PeriodicFrame:
        """Send a frame again and again from the line's thread, where canopen would start another."""
        return PeriodicFrame(self, can_id, data, period)

    def _run(self) -> None:
        try:
            self._serve()
        except Exception:  # the positions behind the encoders may fail: as loud as a broken cable
            _log.exception("the simulated encoders have died")
            self._stopping.set()

    def _serve(self) -> None:
        while not self._stopping.is_set():
            message = self._receive(self._until_next_timer())
            with self.lock:
                if message is not None:
                    self.notify(message.arbitration_id, message.data, message.timestamp)
                self._run_due_timers()

    def _receive(self, timeout_s: float) -> can.Message | None:
        return None if self.bus is None else self.bus.recv(timeout_s)

    def _until_next_timer(self) -> float:
        with self.lock:
            due = self._timers[0].due if self._timers else float("inf")
        return min(max(due - time.monotonic(), 0.0), SLICE_S)

    def _run_due_timers(self) -> None:
        now = time.monotonic()
        while self._timers and self._timers[0].due <= now:
            timer = heapq.heappop(self._timers)
            if not timer.cancelled:
                timer.action()


class PeriodicFrame:
    """A frame that repeats until stopped; what canopen's heartbeat asks of a periodic task."""

    def __init__(self, line: SimulatedCanBus, can_id: int, data: bytes, period_s: float) -> None:
        self._line = line
        self._can_id = can_id
        self._data = data
        self._period_s = period_s
        self._timer = line.call_later(period_s, self._send)

    def update(self, data: bytes) -> None:
        """Repeat other data from now on."""
        self._data = data

    def stop(self) -> None:
        """Send no more."""
        self._timer.cancel()

    def _send(self) -> None:
        self._timer = self._line.call_later(self._period_s, self._send)
        self._line.send_message(self._can_id, self._data)
