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
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[3]))  # of this program; what LinuxCNC's Python has comes first

from drivers.controllers.adapter.served_robot import FailedError, Report, serve
from drivers.controllers.linuxcnc import gcode
from drivers.controllers.linuxcnc_module import status
from drivers.controllers.linuxcnc_module.status import linuxcnc

POLL_S, REPORT_S = 0.005, 0.05
SWITCH_S, REST_S, MESSAGE_S = 5.0, 2.0, 0.2
MOST_REQUESTS, MOST_MESSAGES, MOST_SHOWN = 2, 100, 4
TASK = "milltask"
"""The program that is LinuxCNC's task; what it says of itself stays readable when it is gone."""
ALONE = "See that nobody else moves the robot, then prepare it again"


class Machine:
    """``drivers.controllers.adapter.served_robot.Robot``.

    A command of LinuxCNC's module holds all threads until the task has received it, up to 5 s; so nothing
    else waits in that module.
    """

    def __init__(self) -> None:
        self._reading, self._stopped = threading.Lock(), threading.Event()
        self._own = threading.local()
        self._command: Any = None
        self._abort: Any = None
        self._said: list[str] = []
        self._shown: list[str] = []
        self._restoring = ""
        self._is_ours = False

    def hello(self, _told: Mapping[str, Any]) -> Mapping[str, Any]:
        """Connect to what runs on this computer; nothing moves."""
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
        return {"name": f"LinuxCNC {linuxcnc.version}", "description": Path(stat.ini_filename).name}

    def status(self) -> Mapping[str, Any]:
        """What its task says; error messages are those since it was on."""
        known = len(self._shown)
        stat = self._polled()
        self._read_errors()
        is_on = status.is_on(stat)
        if is_on:
            del self._shown[:known]
        runs_program = stat.task_mode == linuxcnc.MODE_AUTO and stat.interp_state != linuxcnc.INTERP_IDLE
        return {
            "estop": stat.task_state == linuxcnc.STATE_ESTOP,
            "enabled": is_on,
            "homed": status.is_homed(stat),
            "remote": not runs_program,
            "moving": is_on and not status.is_at_rest(stat),
            "errors": self._shown[-MOST_SHOWN:],
            "heartbeat": " ".join(f"{value:.6f}" for value in stat.joint_actual_position[: stat.joints]),
        }

    def position(self) -> Mapping[str, Any]:
        """The actual pose and joints, mm and deg."""
        stat = self._polled()
        if not status.is_homed(stat):
            return {"pose": None, "joints": None}
        return {"pose": status.pose_of(stat, stat.actual_position), "joints": status.joints_of(stat)}

    def start_up(self, action: str) -> None:
        """Do it, and wait until it is so."""
        self._stopped.clear()
        self._is_ours = False  # it leaves MDI mode by itself
        self._take_errors()
        manual, teleop = linuxcnc.MODE_MANUAL, linuxcnc.TRAJ_MODE_TELEOP
        states = {
            "reset-estop": (
                linuxcnc.STATE_ESTOP_RESET,
                lambda stat: stat.task_state != linuxcnc.STATE_ESTOP,
            ),
            "switch-on": (linuxcnc.STATE_ON, status.is_on),
            "switch-off": (linuxcnc.STATE_OFF, lambda stat: not status.is_on(stat)),
        }
        if action in states:
            self._switched("state", *states[action])
        elif action == "home":
            status.require_own_coordinates(self._polled())
            self._switched("mode", manual, lambda stat: stat.task_mode == manual)
            self._switched("teleop_enable", 0, lambda stat: stat.motion_mode != teleop)
            self._order("home", -1)
            if not status.is_homed(self._until(lambda stat: status.is_homed(stat) or self._has_said())):
                raise FailedError("fault", f"is not homed: {self._take_errors()}")
            self._enter_mdi_mode()

    def move(self, pose: Sequence[float], duration_s: float, report: Report) -> None:
        """Move by one block in inverse time; the modes are then what they were."""
        self._stopped.clear()
        was_ours, self._is_ours = self._is_ours, False
        stat = self._polled()
        if not status.is_on(stat) or not status.is_homed(stat):
            raise FailedError("refused", "it is switched off or not homed")
        status.require_own_coordinates(stat)
        if was_ours and stat.task_mode != linuxcnc.MODE_MDI:
            raise FailedError("refused", status.foreign_mode(stat), action=ALONE)
        self._enter_mdi_mode()
        self._take_errors()
        self._restoring = self._restoring or status.restoring_block(stat)
        self._order("mdi", gcode.timed_move(pose, duration_s))
        try:
            stat = self._until(self._is_done, report)
            # where it is to be by now: where it is may lag
            if not status.agree(status.pose_of(stat, stat.position), pose):
                raise self._failure(stat)
        finally:
            self._restore_modes()
        self._is_ours = True

    def stop(self) -> None:
        """Abort what goes on; returns at rest."""
        self._stopped.set()
        if self._abort is not None:
            self._order("abort", channel=self._abort)
            self._wait(lambda stat: not status.is_on(stat) or status.is_at_rest(stat), REST_S)

    def _polled(self) -> Any:  # noqa: ANN401 - of a module without types
        """The status as it is now, each thread its own; without LinuxCNC this program ends, and says so."""
        try:
            self._own.stat = stat = getattr(self._own, "stat", None) or linuxcnc.stat()
            stat.poll()
        except linuxcnc.error as error:
            _end(f"LinuxCNC does not answer: {error}")
        if not _is_task(self._task):
            _end("LinuxCNC has ended")
        return stat

    def _order(self, name: str, *arguments: Any, channel: Any = None) -> None:  # noqa: ANN401
        """Give a command. One that a frozen task has not received stays the next that it receives."""
        channel = channel or self._command
        getattr(channel, name)(*arguments)
        if self._polled().echo_serial_number < channel.serial:
            problem = f"its task is frozen: it has not received '{name}'"
            raise FailedError("fault", problem, action="End LinuxCNC and start it again")

    def _is_done(self, stat: Any) -> bool:  # noqa: ANN401
        """Whether the last command was received and is over; later ones are of other clients."""
        is_received = stat.echo_serial_number >= self._command.serial
        return bool(is_received and stat.state != linuxcnc.RCS_EXEC and status.is_at_rest(stat))

    def _enter_mdi_mode(self) -> None:
        mdi = linuxcnc.MODE_MDI
        self._switched("mode", mdi, lambda stat: stat.task_mode == mdi)

    def _switched(self, name: str, value: int, is_so: Callable[[Any], bool]) -> None:
        """Have it switched, unless it is so; again where that has no effect, as while homing ends."""
        for _ in range(MOST_REQUESTS):
            if is_so(self._polled()):
                return
            self._order(name, value)
            if self._wait(is_so, SWITCH_S):
                return
            if said := self._take_errors():
                break
        action = "Look for a message on the controller's own screen"
        raise FailedError("fault", f"its {name} stays as it is: {said or 'no reason'}", action=action)

    def _wait(self, is_so: Callable[[Any], bool], limit_s: float) -> bool:
        deadline = time.monotonic() + limit_s
        while not is_so(self._polled()):
            if time.monotonic() > deadline:
                return False
            time.sleep(POLL_S)
        return True

    def _until(self, is_so: Callable[[Any], bool], report: Report | None = None) -> Any:  # noqa: ANN401
        """The status when something that moves is over; who asked for it knows how long that may take."""
        reported = time.monotonic()
        while not is_so(stat := self._polled()):
            if self._stopped.is_set():
                raise FailedError("interrupted", "it was stopped")
            if not status.is_on(stat):
                raise self._failure(stat)
            if report is not None and time.monotonic() > reported + REPORT_S:
                reported = time.monotonic()
                report(status.pose_of(stat, stat.actual_position))
            time.sleep(POLL_S)
        return stat

    def _failure(self, stat: Any) -> FailedError:  # noqa: ANN401
        """Why it did not reach its target, by its messages, which may come after its end, or its state."""
        self._wait(lambda _: self._has_said(), MESSAGE_S)
        said = self._take_errors()
        if refused := gcode.parse_pose_refusal(said):
            return FailedError("pose", said, axis=refused[0], highest=refused[1])
        if self._stopped.is_set():
            said = "it was stopped"
        elif not said and not status.is_on(stat):
            said = "it was switched off"
        elif not said and stat.task_mode != linuxcnc.MODE_MDI:
            return FailedError("interrupted", status.foreign_mode(stat), action=ALONE)
        return FailedError("interrupted", said or "it gives no reason")

    def _restore_modes(self) -> None:
        """Restore units, motion and feed mode, where that is possible now; else after a later move."""
        stat = self._polled()
        is_possible = status.is_on(stat) and stat.task_mode == linuxcnc.MODE_MDI
        if is_possible and self._wait(status.is_at_rest, REST_S):
            self._order("mdi", self._restoring)
            if self._wait(self._is_done, SWITCH_S):
                self._restoring = ""

    def _read_errors(self) -> None:
        with self._reading:
            for _ in range(MOST_MESSAGES):
                if (message := self._errors.poll()) is None:
                    break
                kind, text = message
                if kind in {linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR}:
                    self._said.append(text.strip())
                    self._shown.append(text.strip())
            del self._shown[:-MOST_MESSAGES], self._said[:-MOST_MESSAGES]

    def _has_said(self) -> bool:
        self._read_errors()
        return bool(self._said)

    def _take_errors(self) -> str:
        """What it has said that no order has used yet; each once."""
        self._read_errors()
        said, self._said = dict.fromkeys(self._said), []
        more = len(said) - MOST_SHOWN
        return "; ".join([*list(said)[:MOST_SHOWN], *([f"and {more} more"] if more > 0 else [])])


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


if __name__ == "__main__":
    serve(Machine())
