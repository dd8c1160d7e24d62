"""What goes wrong with a simulated cell: at once, or at a moment named beforehand."""

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
from drivers.simulated.gauges.faults import InjectedGaugeFault
from drivers.simulated.gauges.rack import SimulatedGaugeBank
from drivers.simulated.linuxcnc.faults import ControllerFault
from drivers.simulated.linuxcnc.server import SimulatedController
from hexacell.cell.simulation import SimulatedFault
from hexacell.clock import CellClock
from hexacell.errors import UsageError


class FaultKind(StrEnum):
    """What can be made to go wrong with a simulated cell, as its cell file names it."""

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
_OF_GAUGES = {
    FaultKind.UNPLUGGED: InjectedGaugeFault.UNPLUGGED,
    FaultKind.SILENT: InjectedGaugeFault.SILENT,
    FaultKind.AT_END: InjectedGaugeFault.AT_END,
    FaultKind.OFF_PLATE: InjectedGaugeFault.PUSHED,
    FaultKind.FROZEN: InjectedGaugeFault.FROZEN,
}
_OF_ENCODERS = {FaultKind.UNPLUGGED, FaultKind.SILENT, FaultKind.ALARM}
_OF_THE_CONTROLLER = {
    FaultKind.EMERGENCY_STOP,
    FaultKind.FOLLOWING_ERROR,
    FaultKind.UNPLUGGED,
    FaultKind.SILENT,
}


class CellFaults:
    """Breaks and mends the devices of one cell, from any thread; a device is named as in a cell file."""

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
        """Refuse what cannot go wrong.

        Raises:
            UsageError: there is no such device, or it has no such fault.
        """
        if kind in {FaultKind.EMERGENCY_STOP, FaultKind.FOLLOWING_ERROR, FaultKind.STOP_LINE}:
            known = device in {"", CONTROLLER, "stop line"}
        elif device == CONTROLLER:
            known = kind in _OF_THE_CONTROLLER
        elif device.startswith(ENCODER):
            known = kind in _OF_ENCODERS and device[len(ENCODER) :] in set("123456")
        else:
            known = kind in _OF_GAUGES and device in self._gauges.indicators
        if not known:
            raise UsageError(
                f"no fault '{kind}' can be simulated of '{device}'",
                action="Correct kind or device in [[simulation.faults]]",
            )

    def inject(self, kind: FaultKind, device: str = "") -> None:
        """Let something go wrong now; raises ``UsageError``."""
        self._set(kind, device, on=True)

    def clear(self, kind: FaultKind, device: str = "") -> None:
        """Put it right again; a machine that was switched off stays off. Raises ``UsageError``."""
        self._set(kind, device, on=False)

    def _set(self, kind: FaultKind, device: str, *, on: bool) -> None:
        self.check(kind, device)
        if kind is FaultKind.STOP_LINE:
            self._press(on=on)
        elif kind in _OF_THE_CONTROLLER and device in {"", CONTROLLER}:
            self._controller_fault(kind, on=on)
        elif device.startswith(ENCODER):
            self._encoder_fault(kind, int(device[len(ENCODER) :]), on=on)
        elif on:
            self._gauges.inject(device, _OF_GAUGES[kind])
        else:
            self._gauges.clear(device, _OF_GAUGES[kind])

    def _press(self, *, on: bool) -> None:
        if on:
            self._stop_file.touch()
        else:
            self._stop_file.unlink(missing_ok=True)

    def _controller_fault(self, kind: FaultKind, *, on: bool) -> None:
        controller = self._controller
        if kind is FaultKind.UNPLUGGED:
            (controller.unplug if on else controller.plug_in)()
        elif kind is FaultKind.SILENT:
            (controller.faults.inject if on else controller.faults.clear)(ControllerFault.SILENT)
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
    """A fault that struck, and when on the cell's clock."""

    fault: SimulatedFault
    at_s: float


class FaultSchedule(Closeable):
    """Strikes and lifts planned faults at their moments, on a thread of its own.

    Attributes:
        moves: how many moves have begun.
        struck: what struck by now, in order.

    Raises:
        UsageError: a fault is planned that cannot be.
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
        self._news = threading.Condition()
        self._closing = False
        self._thread: threading.Thread | None = None
        begun_s = clock.now()
        for fault in planned:
            self.schedule(fault, begun_s)

    def schedule(self, fault: SimulatedFault, since_s: float | None = None) -> None:
        """Have a fault strike later: in a move, or so long after ``since_s``, which is now by default.

        Raises:
            UsageError: it cannot be simulated.
        """
        self._faults.check(FaultKind(fault.kind), fault.device)
        with self._news:
            if fault.at_move is not None:
                self._waiting.append(fault)
            else:
                self._expect(fault, self._clock.now() if since_s is None else since_s)
            if self._thread is None:
                self._thread = threading.Thread(target=self._serve, name="simulated faults")
                self._thread.start()

    def on_motion_start(self) -> None:
        """Another move has begun now."""
        with self._news:
            self.move_count += 1
            for fault in [fault for fault in self._waiting if fault.at_move == self.move_count]:
                self._waiting.remove(fault)
                self._expect(fault, self._clock.now())

    def close(self) -> None:
        """Let nothing strike any more; twice is harmless."""
        with self._news:
            self._closing = True
            self._news.notify_all()
        if self._thread is not None:
            self._thread.join()

    def _expect(self, fault: SimulatedFault, since_s: float) -> None:
        strikes_at = since_s + fault.after_s
        heapq.heappush(self._due, (strikes_at, next(self._numbers), True, fault))
        if fault.lasts_s is not None:
            heapq.heappush(self._due, (strikes_at + fault.lasts_s, next(self._numbers), False, fault))
        self._news.notify_all()

    def _serve(self) -> None:
        while (due := self._next()) is not None:
            on, fault = due
            if on:
                self.injected.append(InjectedFault(fault, self._clock.now()))
            change = self._faults.inject if on else self._faults.clear
            change(FaultKind(fault.kind), fault.device)

    def _next(self) -> tuple[bool, SimulatedFault] | None:
        """Wait for the next one that is due; nothing when closing."""
        with self._news:
            while not self._closing:
                left = self._due[0][0] - self._clock.now() if self._due else None
                if left is not None and left <= 0.0:
                    _, _, on, fault = heapq.heappop(self._due)
                    return on, fault
                self._news.wait(None if left is None else self._clock.real_seconds(left))
        return None
