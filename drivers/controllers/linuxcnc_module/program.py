"""Serves the LinuxCNC of this computer by the adapter protocol, with its own Python module.

It runs under the Python that LinuxCNC comes with, which has nothing of this program but the files beside
this one, so only Python's own library is used. (LinuxCNC, Python interface.)
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[3]))  # of this program; what LinuxCNC's Python has comes first

from drivers.controllers.adapter.served_robot import FailedError, Report, serve
from drivers.controllers.linuxcnc import gcode

linuxcnc: Any = None
"""The module, which is imported once a controller is asked for: it may be missing."""

POLL_S = 0.005
REPORT_S = 0.05
COMMAND_S, SWITCH_S, REST_S = 20.0, 5.0, 5.0
OFFSET = 1e-6
MOST_REQUESTS = 2
TASK = "milltask"
"""The program that is LinuxCNC's task; what it says of itself stays readable when it is gone."""
AXES = 6
SAME_MM, SAME_DEG = 0.01, 0.01


class Machine:
    """``drivers.controllers.adapter.served_robot.Robot``."""

    def __init__(self) -> None:
        self._lock, self._stopped = threading.RLock(), threading.Event()
        self._said: list[str] = []
        self._shown: list[str] = []

    def hello(self, _told: Mapping[str, Any]) -> Mapping[str, Any]:
        """Connect to what runs on this computer; nothing moves."""
        global linuxcnc  # noqa: PLW0603 - imported when it is known that somebody needs it
        try:
            module = import_module("linuxcnc")
        except ImportError as error:
            action = "Name a Python that has it in controller.options.python, or use linuxcncrsh"
            raise FailedError(
                "fault", f"there is no LinuxCNC for this Python: {error}", action=action
            ) from None
        linuxcnc = module
        self._task = next(_processes(TASK), 0)
        if not self._task:
            raise FailedError("fault", "LinuxCNC does not run on this computer", action="Start it")
        try:
            self._stat, self._errors = linuxcnc.stat(), linuxcnc.error_channel()
            self._command, self._abort = linuxcnc.command(), linuxcnc.command()
            stat = self._polled()
        except linuxcnc.error as error:
            raise FailedError(
                "fault", f"LinuxCNC does not answer: {error}", action="Start it anew"
            ) from None
        return {"name": f"LinuxCNC {linuxcnc.version}", "description": Path(stat.ini_filename).name}

    def status(self) -> Mapping[str, Any]:
        """What its task says."""
        stat = self._polled()
        self._read_errors()
        is_on = stat.task_state == linuxcnc.STATE_ON
        runs_program = stat.task_mode == linuxcnc.MODE_AUTO and stat.interp_state != linuxcnc.INTERP_IDLE
        return {
            "estop": stat.task_state == linuxcnc.STATE_ESTOP,
            "enabled": is_on,
            "homed": self._is_homed(stat),
            "remote": not runs_program,
            "moving": is_on and not self._is_at_rest(stat),
            "errors": self._shown[-4:],
            "heartbeat": " ".join(f"{value:.6f}" for value in stat.joint_actual_position[: stat.joints]),
        }

    def position(self) -> Mapping[str, Any]:
        """The actual pose and joints, mm and deg."""
        stat = self._polled()
        if not self._is_homed(stat):
            return {"pose": None, "joints": None}
        joints = [
            value / (stat.angular_units if joint["jointType"] == linuxcnc.ANGULAR else stat.linear_units)
            for value, joint in zip(stat.joint_actual_position[:AXES], stat.joint[:AXES], strict=True)
        ]
        return {"pose": self._pose(stat), "joints": joints}

    def start_up(self, action: str) -> None:
        """Do it, and wait until it is so."""
        self._stopped.clear()
        self._take_errors()
        if action == "reset-estop":
            reset = linuxcnc.STATE_ESTOP_RESET
            self._switched(
                reset, lambda stat: stat.task_state != linuxcnc.STATE_ESTOP, "stays in emergency stop"
            )
        elif action == "switch-on":
            self._switched(linuxcnc.STATE_ON, self._is_on, "does not switch on")
        elif action == "switch-off":
            self._switched(linuxcnc.STATE_OFF, lambda stat: not self._is_on(stat), "does not switch off")
        elif action == "home":
            self._require_own_coordinates(self._polled())
            self._done(self._command.mode, linuxcnc.MODE_MANUAL)
            self._done(self._command.teleop_enable, 0)
            self._command.home(-1)
            self._until(self._is_homed, None, "is not homed")
            self._enter_mdi_mode()

    def move(self, pose: Sequence[float], duration_s: float, report: Report) -> None:
        """Move by one block in inverse time; the modes are then what they were."""
        self._stopped.clear()
        stat = self._polled()
        if not self._is_on(stat) or not self._is_homed(stat):
            raise FailedError("refused", "it is switched off or not homed")
        self._require_own_coordinates(stat)
        self._enter_mdi_mode()
        self._take_errors()
        with self._modes_restored(stat):
            self._command.mdi(gcode.timed_move(pose, duration_s))
            self._until(self._is_done, report, "does not move")
            here = self._pose(self._polled())
        if not _agree(here, pose):
            reason = self._take_errors() or f"it stopped at {here}"
            raise FailedError("interrupted", reason)

    def stop(self) -> None:
        """Abort what goes on; returns at rest."""
        self._stopped.set()
        self._abort.abort()
        self._abort.wait_complete(SWITCH_S)
        self._wait(lambda stat: not self._is_on(stat) or self._is_at_rest(stat), REST_S)

    def _polled(self) -> Any:  # noqa: ANN401 - of a module without types
        """The status as it is now; without LinuxCNC this program ends, and its end is told."""
        with self._lock:
            try:
                self._stat.poll()
            except linuxcnc.error as error:
                _end(f"LinuxCNC does not answer any more: {error}")
            if not _is_running(self._task):
                _end("LinuxCNC has ended")
            return self._stat

    @staticmethod
    def _is_on(stat: Any) -> bool:  # noqa: ANN401
        return bool(stat.task_state == linuxcnc.STATE_ON)

    @staticmethod
    def _is_homed(stat: Any) -> bool:  # noqa: ANN401
        return all(stat.homed[: stat.joints])

    @staticmethod
    def _is_at_rest(stat: Any) -> bool:  # noqa: ANN401
        is_homing = any(joint["homing"] for joint in stat.joint[: stat.joints])
        return bool(
            stat.inpos and stat.queue == 0 and stat.interp_state == linuxcnc.INTERP_IDLE and not is_homing
        )

    def _is_done(self, stat: Any) -> bool:  # noqa: ANN401
        """Whether the last command was received and is over."""
        is_received = stat.echo_serial_number == self._command.serial
        return bool(is_received and stat.exec_state == linuxcnc.EXEC_DONE and self._is_at_rest(stat))

    @staticmethod
    def _pose(stat: Any) -> list[float]:  # noqa: ANN401
        lengths = [value / stat.linear_units for value in stat.actual_position[:3]]
        return lengths + [value / stat.angular_units for value in stat.actual_position[3:AXES]]

    def _done(self, command: Callable[..., Any], *arguments: Any) -> None:  # noqa: ANN401
        """Give a command that takes no time, and wait until it is over."""
        command(*arguments)
        if self._command.wait_complete(COMMAND_S) == linuxcnc.RCS_ERROR:
            raise FailedError("fault", self._take_errors() or "it refuses a command")

    def _enter_mdi_mode(self) -> None:
        """What is asked for while homing ends may have no effect, so it is asked for again."""
        for _ in range(MOST_REQUESTS):
            if self._polled().task_mode == linuxcnc.MODE_MDI:
                return
            self._done(self._command.mode, linuxcnc.MODE_MDI)
            self._wait(lambda stat: stat.task_mode == linuxcnc.MODE_MDI, SWITCH_S / MOST_REQUESTS)
        raise FailedError("fault", f"does not enter MDI mode: {self._take_errors() or 'no reason'}")

    def _switched(self, state: int, is_so: Callable[[Any], bool], problem: str) -> None:
        self._command.state(state)
        self._command.wait_complete(COMMAND_S)
        if not self._wait(is_so, SWITCH_S):
            action = "Look for a message on the controller's own screen"
            raise FailedError("fault", f"{problem}: {self._take_errors() or 'no reason'}", action=action)

    def _wait(self, is_so: Callable[[Any], bool], limit_s: float) -> bool:
        deadline = time.monotonic() + limit_s
        while not is_so(self._polled()):
            if time.monotonic() > deadline:
                return False
            time.sleep(POLL_S)
        return True

    def _until(self, is_so: Callable[[Any], bool], report: Report | None, problem: str) -> None:
        """Wait until something that moves is over; who asked for it knows how long that may take."""
        reported = time.monotonic()
        while not is_so(stat := self._polled()):
            if self._stopped.is_set():
                raise FailedError("interrupted", "it was stopped")
            if not self._is_on(stat):
                raise FailedError("interrupted", self._take_errors() or "it was switched off")
            if said := self._take_errors():
                refused = gcode.parse_pose_refusal(said)
                if refused is None:
                    raise FailedError("fault", f"it {problem}: {said}")
                axis, highest = refused
                raise FailedError("pose", said, axis=axis, highest=highest)
            if report is not None and time.monotonic() > reported + REPORT_S:
                reported = time.monotonic()
                report(self._pose(stat))
            time.sleep(POLL_S)
        if (said := self._take_errors()) and (refused := gcode.parse_pose_refusal(said)):
            raise FailedError("pose", said, axis=refused[0], highest=refused[1])

    @contextmanager
    def _modes_restored(self, stat: Any) -> Iterator[None]:  # noqa: ANN401
        """Restore units, motion and feed mode as they are now at the end of this context."""
        codes = [f"G{code / 10:g}" for code in stat.gcodes[1:] if code >= 0]
        block = gcode.restoring_block(" ".join((*codes, f"F{stat.settings[1]:g}")))
        try:
            yield
        finally:
            stat = self._polled()
            if self._is_on(stat) and stat.task_mode == linuxcnc.MODE_MDI:
                self._wait(self._is_at_rest, REST_S)
                self._command.mdi(block)
                self._command.wait_complete(SWITCH_S)

    @staticmethod
    def _require_own_coordinates(stat: Any) -> None:  # noqa: ANN401
        """Require that G21 X1 means 1 mm in machine coordinates, and a duration what it says."""
        offsets = (*stat.g5x_offset, *stat.g92_offset)
        if 910 in stat.gcodes:
            problem, action = "takes coordinates as relative (G91)", "Send G90 in MDI"
        elif 430 in stat.gcodes or any(abs(value) > OFFSET for value in stat.tool_offset):
            problem, action = "adds a tool length (G43)", "Send G49 in MDI"
        elif any(abs(value) > OFFSET for value in offsets):
            problem = f"adds an offset of {offsets} to every coordinate (G54, G92)"
            action = "Clear it: G10 L2 P1 X0 Y0 Z0 A0 B0 C0 and G92.1 in MDI"
        elif stat.feedrate > 1.0 + OFFSET:
            problem = f"moves {100 * stat.feedrate:g} % as fast as it is commanded (feed override)"
            action = "Set the feed override to 100 % or less"
        else:
            return
        raise FailedError("refused", problem, action=action)

    def _read_errors(self) -> None:
        with self._lock:
            while (message := self._errors.poll()) is not None:
                kind, text = message
                if kind in {linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR}:
                    self._said.append(text.strip())
                    self._shown.append(text.strip())
            del self._shown[:-20], self._said[:-20]

    def _take_errors(self) -> str:
        """What it has said that no order has used yet."""
        with self._lock:
            self._read_errors()
            said, self._said = self._said, []
        return "; ".join(said)


def _agree(one: Sequence[float], other: Sequence[float]) -> bool:
    differences = [abs(a - b) for a, b in zip(one, other, strict=True)]
    return (
        max(differences[:3]) < SAME_MM
        and max(abs((d + 180) % 360 - 180) for d in differences[3:]) < SAME_DEG
    )


def _processes(name: str) -> Iterator[int]:
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit() and _is_running(int(folder.name), name):
            yield int(folder.name)


def _is_running(process: int, name: str = TASK) -> bool:
    """Whether there is such a process that has not ended: what is left of one has the state Z."""
    try:
        said = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return f"({name})" in said and said.rpartition(")")[2].split()[0] != "Z"


def _end(problem: str) -> None:
    sys.stderr.write(f"{problem}\n")
    sys.stderr.flush()
    os._exit(1)


if __name__ == "__main__":
    serve(Machine())
