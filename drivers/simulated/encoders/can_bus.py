"""The simulated CAN bus: one thread that receives frames, runs timers and sends frames."""

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
    """An action at a time, which can be cancelled before."""

    due: float
    sequence: int
    action: Callable[[], None] = field(compare=False)
    cancelled: bool = field(default=False, compare=False)

    def cancel(self) -> None:
        """Cancel the action."""
        self.cancelled = True


class SimulatedCanBus(canopen.Network):
    """A CANopen network for simulated nodes on python-can's ``virtual`` interface.

    Nodes act only with ``lock`` held, on the thread of the bus or on one that injects a fault.
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
        """Start to receive frames."""
        self._thread.start()

    def stop(self) -> None:
        """Become silent permanently; stopping twice is harmless."""
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def close(self) -> None:
        """Stop, and close the channel."""
        self.stop()
        if self.bus is not None:
            self.bus.shutdown()

    def call_later(self, seconds: float, action: Callable[[], None]) -> Timer:
        """Run ``action`` after so many seconds of real time."""
        timer = Timer(time.monotonic() + seconds, next(self._sequence), action)
        with self.lock:
            heapq.heappush(self._timers, timer)
        return timer

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send one frame, unless the bus was stopped."""
        if not self._stopping.is_set():
            super().send_message(can_id, data, remote)

    def send_periodic(  # type: ignore[override]
        self,
        can_id: int,
        data: bytes,
        period: float,
        remote: bool = False,  # noqa: ARG002
    ) -> PeriodicFrame:
        """Send a frame periodically from the thread of the bus; canopen would start another thread."""
        return PeriodicFrame(self, can_id, data, period)

    def _run(self) -> None:
        try:
            self._serve()
        except Exception:  # an error of the simulated physics appears as a silent bus
            _log.exception("the simulated encoders have failed")
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
    """A periodic frame, with the interface that canopen expects for its heartbeat."""

    def __init__(self, bus: SimulatedCanBus, can_id: int, data: bytes, period_s: float) -> None:
        self._bus = bus
        self._can_id = can_id
        self._data = data
        self._period_s = period_s
        self._timer = bus.call_later(period_s, self._send)

    def update(self, data: bytes) -> None:
        """Send other data from now on."""
        self._data = data

    def stop(self) -> None:
        """Send no more."""
        self._timer.cancel()

    def _send(self) -> None:
        self._timer = self._bus.call_later(self._period_s, self._send)
        self._bus.send_message(self._can_id, self._data)
