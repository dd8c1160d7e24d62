"""Serves the LinuxCNC of this computer by the adapter protocol, with its own Python module.

It runs under the Python that LinuxCNC comes with, which has nothing of this program but the files beside
this one, so only Python's own library is used. (LinuxCNC, Python interface.)
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[3]))  # of this program; what LinuxCNC's Python has comes first

from drivers.controllers.adapter.served_robot import FailedError, Told, serve
from drivers.controllers.linuxcnc.access import Order
from drivers.controllers.linuxcnc.machine import REST_S, Machine

try:
    linuxcnc: Any = import_module("linuxcnc")
except ImportError:  # told when a controller is asked for
    linuxcnc = None

MOST_MESSAGES = 100
TASK = "milltask"
"""The program that is LinuxCNC's task; what it says of itself stays readable when it is gone."""

AXES = 6
SAME_MM, SAME_DEG, NO_LENGTH = 0.01, 0.01, 1e-6
TOOL_LENGTH = 430
"""G43 among the codes, which are tenths of those that are written."""


class ModuleState:
    """``access.State`` of one ``linuxcnc.stat`` that was polled."""

    def __init__(self, stat: Any) -> None:  # noqa: ANN401 - of a module without types
        self._stat = stat
        self.serial, self.is_executing = stat.echo_serial_number, stat.state == linuxcnc.RCS_EXEC
        self.is_on = stat.task_state == linuxcnc.STATE_ON
        self.estop = stat.task_state == linuxcnc.STATE_ESTOP
        self.is_homed = all(stat.homed[: stat.joints])
        modes = {linuxcnc.MODE_MANUAL: "manual", linuxcnc.MODE_AUTO: "automatic", linuxcnc.MODE_MDI: "mdi"}
        self.mode = modes.get(stat.task_mode, "another")
        self.is_teleop = stat.motion_mode == linuxcnc.TRAJ_MODE_TELEOP
        is_idle = stat.interp_state == linuxcnc.INTERP_IDLE
        self.runs_program = stat.task_mode == linuxcnc.MODE_AUTO and not is_idle
        is_homing = any(joint["homing"] for joint in stat.joint[: stat.joints])
        self.is_at_rest = bool(stat.inpos and stat.queue == 0 and is_idle and not is_homing)
        self.pose = self._in_mm_and_deg(stat.actual_position)
        pairs = zip(stat.joint_actual_position[:AXES], stat.joint[:AXES], strict=True)
        self.joints = [value / self._unit(joint) for value, joint in pairs]
        codes = {*stat.gcodes[1:]} | ({TOOL_LENGTH} if any(map(_is_length, stat.tool_offset)) else set())
        self.codes = " ".join([f"G{one / 10:g}" for one in codes if one >= 0] + [f"F{stat.settings[1]:g}"])
        self.offset = [a + b for a, b in zip(stat.g5x_offset, stat.g92_offset, strict=True)]
        self.feed_percent = 100.0 * stat.feedrate

    def is_at(self, pose: Sequence[float]) -> bool:
        """Whether it is to be there by now: where it is may lag."""
        there = self._in_mm_and_deg(self._stat.position)
        differences = [abs(a - b) for a, b in zip(there, pose, strict=True)]
        turned = [abs((one + 180.0) % 360.0 - 180.0) for one in differences[3:]]
        return max(differences[:3]) < SAME_MM and max(turned) < SAME_DEG

    def _in_mm_and_deg(self, position: Sequence[float]) -> list[float]:
        lengths = [value / self._stat.linear_units for value in position[:3]]
        return lengths + [value / self._stat.angular_units for value in position[3:AXES]]

    def _unit(self, joint: Any) -> float:  # noqa: ANN401
        is_angular = joint["jointType"] == linuxcnc.ANGULAR
        return float(self._stat.angular_units if is_angular else self._stat.linear_units)


class ModuleAccess:
    """``access.Access`` by LinuxCNC's module.

    A command of the module holds all threads until the task has received it, up to 5 s; so nothing else
    waits in that module.
    """

    poll_s = 0.005
    is_refused = False

    def __init__(self) -> None:
        self._own = threading.local()

    def connect(self, _told: Told) -> Told:
        """Connect to what runs on this computer."""
        if linuxcnc is None:
            action = "Name a Python that has it in controller.options.python, or use linuxcncrsh"
            raise FailedError("fault", "this Python has no module linuxcnc", action=action)
        self._task = next(_processes(), 0)
        if not self._task:
            raise FailedError("fault", "LinuxCNC does not run on this computer", action="Start it")
        stat = self._polled()
        if not stat.linear_units:
            _end("LinuxCNC is still starting")
        self._errors = linuxcnc.error_channel()
        self._command, self._abort = linuxcnc.command(), linuxcnc.command()
        teleop, modes = self._command.teleop_enable, self._command.mode
        self._calls: dict[Order, tuple[Any, tuple[int, ...]]] = {
            Order.ESTOP_OFF: (self._command.state, (linuxcnc.STATE_ESTOP_RESET,)),
            Order.MACHINE_ON: (self._command.state, (linuxcnc.STATE_ON,)),
            Order.MACHINE_OFF: (self._command.state, (linuxcnc.STATE_OFF,)),
            Order.MANUAL: (modes, (linuxcnc.MODE_MANUAL,)),
            Order.MDI: (modes, (linuxcnc.MODE_MDI,)),
            Order.TELEOP_OFF: (teleop, (0,)),
            Order.HOME: (self._command.home, (-1,)),
        }
        return {"name": f"LinuxCNC {linuxcnc.version}", "description": Path(stat.ini_filename).name}

    def claim(self) -> None:
        """All clients of the module may command."""

    def state(self) -> ModuleState:
        """Its state; without LinuxCNC this program ends, and says so."""
        return ModuleState(self._polled())

    def order(self, order: Order) -> bool:
        """Give an order."""
        call, arguments = self._calls[order]
        call(*arguments)
        self._require_received(self._command, order.value)
        return True

    def begin(self, block: str) -> None:
        """Have a block executed."""
        self._command.mdi(block)
        self._require_received(self._command, "mdi")

    def is_over(self, state: Any, pose: Sequence[float] | None = None) -> bool:  # noqa: ANN401 - ModuleState
        """Whether the block was received and is over; later commands are of other clients."""
        del pose
        is_received = state.serial >= self._command.serial
        return bool(is_received and not state.is_executing and state.is_at_rest)

    def abort(self) -> None:
        """Stop what moves, by a channel of its own."""
        self._abort.abort()
        self._require_received(self._abort, "abort")
        deadline = time.monotonic() + REST_S
        while (state := self.state()).is_on and not state.is_at_rest and time.monotonic() < deadline:
            time.sleep(self.poll_s)

    def messages(self) -> list[str]:
        """Its error messages; what it only tells is none."""
        found = []
        try:
            for _ in range(MOST_MESSAGES):
                if (message := self._errors.poll()) is None:
                    break
                kind, text = message
                if kind in {linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR}:
                    found.append(text)
        except linuxcnc.error as error:
            _end(f"LinuxCNC does not answer: {error}")
        return found

    def _polled(self) -> Any:  # noqa: ANN401
        """The status as it is now, each thread its own."""
        try:
            self._own.stat = stat = getattr(self._own, "stat", None) or linuxcnc.stat()
            stat.poll()
        except linuxcnc.error as error:
            _end(f"LinuxCNC does not answer: {error}")
        if not _is_task(self._task):
            _end("LinuxCNC has ended")
        return stat

    def _require_received(self, channel: Any, name: str) -> None:  # noqa: ANN401
        """Require that the task has received the last command, which stays the next that it receives."""
        if self._polled().echo_serial_number < channel.serial:
            problem = f"its task is frozen: it has not received '{name}'"
            raise FailedError("fault", problem, action="End LinuxCNC and start it again")


def _is_length(value: float) -> bool:
    return abs(value) > NO_LENGTH


def _processes() -> Iterator[int]:
    return (
        int(one.name) for one in Path("/proc").iterdir() if one.name.isdigit() and _is_task(int(one.name))
    )


def _is_task(process: int) -> bool:
    """Whether there is such a task that has not ended: what is left of one has the state Z."""
    try:
        said = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return f"({TASK})" in said and said.rpartition(")")[2].split()[0] != "Z"


def _end(problem: str) -> None:
    sys.stderr.write(f"{problem}\n")
    sys.stderr.flush()
    os._exit(1)


def main() -> None:
    """Serve on stdin and stdout until they end; what LinuxCNC's library prints goes to stderr."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    machine = Machine(ModuleAccess())
    serve(machine, answers=answers)
    # Not by the ends of its channels: of a LinuxCNC that was restarted they remove what the new one uses.
    os._exit(0)


if __name__ == "__main__":
    main()
