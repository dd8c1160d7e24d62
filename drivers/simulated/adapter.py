"""The simulated controller behind the adapter protocol, over TCP on the loopback interface."""

import socket
import socketserver
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, Future, wait
from contextlib import suppress
from pathlib import Path

from drivers.controllers.adapter.served_robot import FailedError, Report, Told, serve
from drivers.controllers.linuxcnc.gcode import parse_pose_refusal
from drivers.simulated.linuxcnc.server import SimulatedController
from drivers.simulated.linuxcnc.state import ConnectionCut, ControllerState, Machine, TaskMode
from hexacell.cell.robot import ControllerSettings
from hexacell.kinematics.pose import Pose

REPORT_S = 0.05
LEFT_WITHIN_S = 1.0
"""How long a client that has just gone may still be noticed, s."""


class _Handler(socketserver.BaseRequestHandler):
    server: "SimulatedAdapter"
    request: socket.socket

    def handle(self) -> None:
        if not self.server.in_use.acquire(timeout=LEFT_WITHIN_S):
            return  # it serves somebody already
        try:
            with suppress(OSError), self.request.makefile("w") as answers:
                serve(self.server.robot, self._lines(), answers)
        finally:
            self.server.in_use.release()

    def _lines(self) -> Iterator[str]:
        with suppress(OSError), self.request.makefile() as lines:
            yield from (line for line in lines if not self.server.is_silent)


class SimulatedAdapter(SimulatedController):
    """Serves one client at a time until it is closed."""

    handler = _Handler

    def __init__(self, machine: Machine, settings: ControllerSettings) -> None:
        self.in_use = threading.Lock()
        super().__init__(machine, settings)
        self.robot = _Robot(self.state, Path(settings.config).name)

    def set_frozen(self, *, on: bool) -> None:
        """Answer what was so before, and carry out nothing, or work again; the machine continues."""
        self.robot.set_frozen(on=on)


class _Robot:
    """``drivers.controllers.adapter.served_robot.Robot``."""

    def __init__(self, state: ControllerState, description: str) -> None:
        self._state, self._description = state, description
        self._errors: list[str] = []
        self._frozen: tuple[Told, Told] | None = None
        self._thawed = threading.Event()
        self._thawed.set()

    def set_frozen(self, *, on: bool) -> None:
        self._frozen = (self.status(), self.position()) if on else None
        (self._thawed.clear if on else self._thawed.set)()

    def hello(self, _settings: Told) -> Told:
        return {"name": "simulated controller", "description": self._description}

    def status(self) -> Told:
        if self._frozen is not None:
            return self._frozen[0]
        state = self._state
        self._read_errors()
        return {
            "estop": state.estop,
            "enabled": state.enabled,
            "homed": state.homed,
            "remote": True,
            "moving": state.is_moving,
            "errors": self._errors,
            "heartbeat": " ".join(f"{joint:.6f}" for joint in state.machine.joints()),
        }

    def position(self) -> Told:
        if self._frozen is not None:
            return self._frozen[1]
        if not self._state.homed:
            return {"pose": None, "joints": None}
        machine = self._state.machine
        return {"pose": list(machine.pose().as_tuple()), "joints": list(machine.joints())}

    def start_up(self, action: str) -> None:
        self._thawed.wait()
        state, self._errors = self._state, []
        match action:
            case "reset-estop":
                state.set_estop(on=False)
            case "switch-on":
                state.set_machine(on=True)
                if not state.enabled:
                    self._read_errors()
                    raise FailedError("refused", "; ".join(self._errors) or "it is in emergency stop")
            case "switch-off":
                state.set_machine(on=False)
            case "home":
                state.mode, state.teleop = TaskMode.MANUAL, False
                state.home()
                while state.is_moving:
                    self._thawed.wait(REPORT_S)
                if not state.homed:
                    raise FailedError("interrupted", "it was stopped")
            case _:  # its geometry is read when it is switched on
                pass

    def move(self, pose: Sequence[float], duration_s: float, report: Report) -> None:
        self._thawed.wait()
        state, self._errors = self._state, []
        if not (state.enabled and state.homed):
            raise FailedError("refused", "it is switched off, or not homed")
        stops = state.stop_count
        with suppress(CancelledError, ConnectionCut):
            self._wait_for(state.travel(Pose(*pose), duration_s), report)
        self._read_errors()
        if reason := "; ".join(self._errors):
            if (found := parse_pose_refusal(reason)) is None:
                raise FailedError("fault", reason)
            raise FailedError("pose", reason, axis=found[0], highest=found[1])
        if state.stop_count != stops:
            raise FailedError("interrupted", "it was stopped")

    def _wait_for(self, motion: Future[bool], report: Report) -> None:
        while wait((motion,), REPORT_S).not_done:
            report(self._state.machine.pose().as_tuple())
        motion.result()

    def stop(self) -> None:
        if self._frozen is None:
            self._state.abort()

    def _read_errors(self) -> None:
        while (text := self._state.next_error()) != "OK":
            self._errors.append(text)
