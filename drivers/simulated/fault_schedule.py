"""Faults of a simulated cell, injected at once or on schedule."""

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import itemgetter
from pathlib import Path

from drivers.simulated.encoders.bank import SimulatedDbcBank, SimulatedEncoderBank
from drivers.simulated.encoders.modbus_bank import SimulatedModbusBank
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from drivers.simulated.linuxcnc.server import SimulatedController
from drivers.simulated.robot import SimulatedMachine
from drivers.simulated.served_device import Closeable, Switch, lasting, setting
from hexacell.cell.simulation import FaultKind, SimulatedFault
from hexacell.clock import CellClock
from hexacell.errors import UsageError


class CellFaults:
    """Injects and clears faults of one cell, from any thread; devices are named as in the cell file."""

    def __init__(
        self,
        gauges: SimulatedGaugeBank,
        encoders: SimulatedEncoderBank | SimulatedDbcBank | SimulatedModbusBank,
        controller: SimulatedController,
        machine: SimulatedMachine,
        stop_file: Path,
    ) -> None:
        of_cell: dict[FaultKind, Switch] = {
            "emergency stop": lasting(partial(controller.state.set_estop, on=True)),
            "following error": lasting(controller.state.exceed_following_error),
            "stop line": partial(_set_stop_file, stop_file),
        }
        of_controller: dict[FaultKind, Switch] = {
            "unplugged": controller.set_unplugged,
            "silent": setting(controller, "is_silent"),
            "forward kinematics": setting(machine, "fails_forward"),
            "old config": setting(machine, "keeps_geometry"),
            "ignored corrections": setting(machine, "ignores_corrections"),
            "frozen": controller.set_frozen,
        }
        self._switches: dict[str, Mapping[FaultKind, Switch]] = {
            **{name: gauges.faults(name) for name in gauges.indicators},
            **{
                f"encoder {leg}": encoders.faults(leg)
                for leg in range(1, machine.mechanism.joint_count + 1)
            },
            "controller": of_cell | of_controller,
            "stop line": of_cell,
            "": of_cell,
        }

    def check(self, kind: FaultKind, device: str) -> None:
        """Check that a fault can be simulated.

        Raises:
            UsageError: there is no such device, or not with such a fault.
        """
        if kind in self._switches.get(device, {}):
            return
        devices = [name for name, faults in self._switches.items() if name and kind in faults]
        if devices:
            action = f"Name one of {', '.join(devices)}"
        else:
            action = f"'{device}' has {', '.join(self._switches.get(device, self._switches['']))}"
        raise UsageError(f"no fault '{kind}' can be simulated of '{device}'", action=action)

    def inject(self, kind: FaultKind, device: str = "") -> None:
        """Inject a fault now; raises ``UsageError``."""
        self.check(kind, device)
        self._switches[device][kind](on=True)

    def clear(self, kind: FaultKind, device: str = "") -> None:
        """Clear a fault; a machine that was switched off stays off. Raises ``UsageError``."""
        self.check(kind, device)
        self._switches[device][kind](on=False)


def _set_stop_file(stop_file: Path, *, on: bool) -> None:
    if on:
        stop_file.touch()
    else:
        stop_file.unlink(missing_ok=True)


class FaultSchedule(Closeable):
    """Injects and clears scheduled faults, from timers, in the order in which they are due.

    ``move_count`` is how many moves have started. Raises ``UsageError`` if a fault cannot be simulated.
    """

    def __init__(
        self, faults: CellFaults, clock: CellClock, planned: Sequence[SimulatedFault] = ()
    ) -> None:
        self.move_count = 0
        self._faults = faults
        self._clock = clock
        self._waiting: list[SimulatedFault] = []
        self._due: list[tuple[float, Callable[[], None]]] = []
        self._timers: list[threading.Timer] = []
        self._is_closed = False
        self._lock, self._one_at_a_time = threading.Lock(), threading.Lock()
        self.schedule(*planned)

    def schedule(self, *planned: SimulatedFault) -> None:
        """Schedule faults: in a move, some time after now, or at once: then they are there on return.

        Raises:
            UsageError: one cannot be simulated.
        """
        for fault in planned:
            self._faults.check(fault.kind, fault.device)
        with self._lock:
            now_s = self._clock.now()
            self._waiting += [fault for fault in planned if fault.at_move is not None]
            timed = [fault for fault in planned if fault.at_move is None]
            started = [(fault, self._enqueue(fault, now_s)) for fault in timed]
        for fault, timers in started:
            if timers and not fault.after_s:
                timers[0].join()

    def on_motion_start(self) -> None:
        """Count a move, and schedule the faults that wait for it."""
        with self._lock:
            self.move_count += 1
            now_s = self._clock.now()
            for fault in [fault for fault in self._waiting if fault.at_move == self.move_count]:
                self._waiting.remove(fault)
                self._enqueue(fault, now_s)

    def close(self) -> None:
        with self._lock:
            self._is_closed = True
        for timer in self._timers:
            timer.cancel()
            timer.join()

    def _enqueue(self, fault: SimulatedFault, now_s: float) -> list[threading.Timer]:
        switches = [(fault.after_s, self._faults.inject)]
        if fault.lasts_s is not None:
            switches.append((fault.after_s + fault.lasts_s, self._faults.clear))
        timers = []
        for after_s, switch in switches if not self._is_closed else ():
            due_s, carry_out = now_s + after_s, partial(switch, fault.kind, fault.device)
            self._due.append((due_s, carry_out))
            timers.append(threading.Timer(self._clock.real_seconds(after_s), self._do_next))
            timers[-1].start()
        self._timers += timers
        return timers

    def _do_next(self) -> None:
        """Do what is due first: on a busy machine a timer may be later than the one after it."""
        with self._one_at_a_time:
            with self._lock:
                first = min(self._due, key=itemgetter(0))
                self._due.remove(first)
            first[1]()
