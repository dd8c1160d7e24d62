"""The simulated CAN bus: one thread that receives frames, runs timers and sends frames."""

import logging
import sched
import threading
import time
from collections.abc import Callable

import can
import canopen

_log = logging.getLogger(__name__)

SLICE_S = 0.02
"""Longest wait for a frame, s; a timer set by another thread may be so late."""


class SimulatedCanBus(canopen.Network):
    """A CANopen network for simulated nodes on python-can's ``virtual`` interface.

    Nodes act only with ``lock`` held, on the thread of the bus or on one that injects a fault.
    """

    def __init__(self, channel: str) -> None:
        # A bounded receive queue would make senders on this interface block for ever.
        super().__init__(can.Bus(channel, interface="virtual"))
        self.lock = threading.RLock()
        self._now_s = time.monotonic()
        # The time stands still during a run: periodic frames that take longer than their period end it.
        self._timers = sched.scheduler(lambda: self._now_s)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="simulated encoders", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """Become silent permanently; closing twice is harmless."""
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()
        if self.bus is not None:
            self.bus.shutdown()

    def call_later(self, seconds: float, action: Callable[[], None]) -> sched.Event:
        """Run ``action`` after so many seconds of real time."""
        return self._timers.enterabs(time.monotonic() + seconds, 0, action)

    def cancel(self, timer: sched.Event) -> None:
        self._timers.cancel(timer)

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
    ) -> "PeriodicFrame":
        """Send a frame periodically from the thread of the bus; canopen would start another thread."""
        return PeriodicFrame(self, can_id, data, period)

    def _run(self) -> None:
        left_s = SLICE_S
        try:
            while not self._stopping.is_set() and self.bus is not None:
                message = self.bus.recv(min(left_s, SLICE_S))
                with self.lock:
                    if message is not None:
                        self.notify(message.arbitration_id, message.data, message.timestamp)
                    self._now_s = time.monotonic()
                    next_s = self._timers.run(blocking=False)
                    left_s = SLICE_S if next_s is None else next_s
        except Exception:  # an error of the simulated physics appears as a silent bus
            _log.exception("the simulated encoders have failed")
            self._stopping.set()


class PeriodicAction:
    """An action that the thread of the bus repeats until it is stopped."""

    def __init__(self, bus: SimulatedCanBus, period_s: float, action: Callable[[], None]) -> None:
        self._bus = bus
        self._period_s = period_s
        self._action = action
        self._timer = bus.call_later(period_s, self._run)

    def stop(self) -> None:
        """Stop it; once only."""
        self._bus.cancel(self._timer)

    def _run(self) -> None:
        self._timer = self._bus.call_later(self._period_s, self._run)
        self._action()


class PeriodicFrame(PeriodicAction):
    """A periodic frame, with the interface that canopen expects for its heartbeat."""

    def __init__(self, bus: SimulatedCanBus, can_id: int, data: bytes, period_s: float) -> None:
        super().__init__(bus, period_s, lambda: bus.send_message(can_id, self._data))
        self._data = data

    def update(self, data: bytes) -> None:
        self._data = data
