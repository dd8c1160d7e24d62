"""Faults of a simulated cell, injected at once or on schedule."""

from __future__ import annotations

import heapq
import itertools
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from drivers.simulated.closeable import Closeable
from drivers.simulated.encoders import SimulatedEncoderBank
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from drivers.simulated.gauges.faults import InjectedGaugeFault
from drivers.simulated.linuxcnc.server import SimulatedController
from hexacell.cell.simulation import SimulatedFault
from hexacell.clock import CellClock
from hexacell.errors import UsageError


class FaultKind(StrEnum):
    """The kinds of faults, as named in the cell file."""

    EMERGENCY_STOP = "emergency stop"
    FOLLOWING_ERROR = "following error"
    STOP_LINE = "stop line"
    UNPLUGGED = "unplugged"
    SILENT = "silent"
    AT_END = "at its end"
    OFF_PLATE = "off its plate"
    FROZEN = "frozen"
    ALARM = "alarm"


CONTROLLER = "controller"
ENCODER = "encoder "
_GAUGE_FAULTS = {
    FaultKind.UNPLUGGED: InjectedGaugeFault.UNPLUGGED,
    FaultKind.SILENT: InjectedGaugeFault.SILENT,
    FaultKind.AT_END: InjectedGaugeFault.AT_END,
    FaultKind.OFF_PLATE: InjectedGaugeFault.PUSHED,
    FaultKind.FROZEN: InjectedGaugeFault.FROZEN,
}
_ENCODER_FAULTS = {FaultKind.UNPLUGGED, FaultKind.SILENT, FaultKind.ALARM}
_CONTROLLER_FAULTS = {
    FaultKind.EMERGENCY_STOP,
    FaultKind.FOLLOWING_ERROR,
    FaultKind.UNPLUGGED,
    FaultKind.SILENT,
}


class CellFaults:
    """Injects and clears faults of one cell, from any thread; devices are named as in the cell file."""

    def __init__(
        self,
        gauges: SimulatedGaugeBank,
        encoders: SimulatedEncoderBank,
        controller: SimulatedController,
        stop_file: Path,
    ) -> None:
        self._gauges = gauges
        self._encoders = encoders
        self._controller = controller
        self._stop_file = stop_file

    def check(self, kind: FaultKind, device: str) -> None:
        """Check that a fault can be simulated.

        Raises:
            UsageError: there is no such device, or not with such a fault.
        """
        if kind in {FaultKind.EMERGENCY_STOP, FaultKind.FOLLOWING_ERROR, FaultKind.STOP_LINE}:
            known = device in {"", CONTROLLER, "stop line"}
        elif device == CONTROLLER:
            known = kind in _CONTROLLER_FAULTS
        elif device.startswith(ENCODER):
            known = kind in _ENCODER_FAULTS and device[len(ENCODER) :] in set("123456")
        else:
            known = kind in _GAUGE_FAULTS and device in self._gauges.indicators
        if not known:
            raise UsageError(
                f"no fault '{kind}' can be simulated of '{device}'",
                action="Correct kind or device in [[simulation.faults]]",
            )

    def inject(self, kind: FaultKind, device: str = "") -> None:
        """Inject a fault now; raises ``UsageError``."""
        self._set(kind, device, on=True)

    def clear(self, kind: FaultKind, device: str = "") -> None:
        """Clear a fault; a machine that was switched off stays off. Raises ``UsageError``."""
        self._set(kind, device, on=False)

    def _set(self, kind: FaultKind, device: str, *, on: bool) -> None:
        self.check(kind, device)
        if kind is FaultKind.STOP_LINE:
            self._set_stop_file(on=on)
        elif kind in _CONTROLLER_FAULTS and device in {"", CONTROLLER}:
            self._controller_fault(kind, on=on)
        elif device.startswith(ENCODER):
            self._encoder_fault(kind, int(device[len(ENCODER) :]), on=on)
        elif on:
            self._gauges.inject(device, _GAUGE_FAULTS[kind])
        else:
            self._gauges.clear(device, _GAUGE_FAULTS[kind])

    def _set_stop_file(self, *, on: bool) -> None:
        if on:
            self._stop_file.touch()
        else:
            self._stop_file.unlink(missing_ok=True)

    def _controller_fault(self, kind: FaultKind, *, on: bool) -> None:
        controller = self._controller
        if kind is FaultKind.UNPLUGGED:
            (controller.unplug if on else controller.plug_in)()
        elif kind is FaultKind.SILENT:
            controller.silence(silent=on)
        elif on and kind is FaultKind.EMERGENCY_STOP:
            controller.state.set_estop(on=True)
        elif on:
            controller.state.exceed_following_error()

    def _encoder_fault(self, kind: FaultKind, leg: int, *, on: bool) -> None:
        faults = self._encoders.faults
        if kind is FaultKind.UNPLUGGED:
            (faults.unplug if on else faults.plug_in)(leg)
        elif kind is FaultKind.SILENT:
            faults.silence(leg, silent=on)
        else:
            (faults.emergency if on else faults.clear_emergency)(leg)


@dataclass(frozen=True, slots=True)
class InjectedFault:
    """An injected fault, and the time on the cell's clock."""

    fault: SimulatedFault
    at_s: float


class FaultSchedule(Closeable):
    """Injects and clears scheduled faults, on a thread of its own.

    Attributes:
        move_count: how many moves have started.
        injected: the faults injected so far, in order.

    Raises:
        UsageError: a scheduled fault cannot be simulated.
    """

    def __init__(
        self, faults: CellFaults, clock: CellClock, planned: Sequence[SimulatedFault] = ()
    ) -> None:
        self.move_count = 0
        self.injected: list[InjectedFault] = []
        self._faults = faults
        self._clock = clock
        self._waiting: list[SimulatedFault] = []
        self._due: list[tuple[float, int, bool, SimulatedFault]] = []
        self._numbers = itertools.count()
        self._changed = threading.Condition()
        self._closing = False
        self._thread: threading.Thread | None = None
        start_s = clock.now()
        for fault in planned:
            self.schedule(fault, start_s)

    def schedule(self, fault: SimulatedFault, since_s: float | None = None) -> None:
        """Schedule a fault: in a move, or some time after ``since_s``, by default now.

        Raises:
            UsageError: it cannot be simulated.
        """
        self._faults.check(FaultKind(fault.kind), fault.device)
        with self._changed:
            if fault.at_move is not None:
                self._waiting.append(fault)
            else:
                self._enqueue(fault, self._clock.now() if since_s is None else since_s)
            if self._thread is None:
                self._thread = threading.Thread(target=self._serve, name="simulated faults")
                self._thread.start()

    def on_motion_start(self) -> None:
        """Count a move, and schedule the faults that wait for it."""
        with self._changed:
            self.move_count += 1
            for fault in [fault for fault in self._waiting if fault.at_move == self.move_count]:
                self._waiting.remove(fault)
                self._enqueue(fault, self._clock.now())

    def close(self) -> None:
        """Inject no more faults; closing twice is harmless."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join()

    def _enqueue(self, fault: SimulatedFault, since_s: float) -> None:
        injected_at = since_s + fault.after_s
        heapq.heappush(self._due, (injected_at, next(self._numbers), True, fault))
        if fault.lasts_s is not None:
            heapq.heappush(self._due, (injected_at + fault.lasts_s, next(self._numbers), False, fault))
        self._changed.notify_all()

    def _serve(self) -> None:
        while (due := self._next()) is not None:
            on, fault = due
            if on:
                self.injected.append(InjectedFault(fault, self._clock.now()))
            change = self._faults.inject if on else self._faults.clear
            change(FaultKind(fault.kind), fault.device)

    def _next(self) -> tuple[bool, SimulatedFault] | None:
        """Wait for the next due fault; nothing when closing."""
        with self._changed:
            while not self._closing:
                left = self._due[0][0] - self._clock.now() if self._due else None
                if left is not None and left <= 0.0:
                    _, _, on, fault = heapq.heappop(self._due)
                    return on, fault
                self._changed.wait(None if left is None else self._clock.real_seconds(left))
        return None
