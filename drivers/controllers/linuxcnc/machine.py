"""A LinuxCNC as a robot that is served by the adapter protocol, whatever the way to it.

An order that is received may have no effect: ``machine on`` in emergency stop, and MDI mode before homing,
are accepted and do nothing. So each is verified by the state.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from drivers.controllers.adapter.served_robot import FailedError, Report, Told
from drivers.controllers.linuxcnc import gcode
from drivers.controllers.linuxcnc.access import (
    ALONE,
    MDI,
    Access,
    Order,
    State,
    foreign_mode,
    require_own_coordinates,
)

_AXES = "xyzabc"
REPORT_S = 0.05
SWITCH_S, REST_S, MESSAGE_S = 5.0, 2.0, 0.2
MOST_REQUESTS, MOST_MESSAGES, MOST_SHOWN = 2, 100, 4


class Machine:
    """``drivers.controllers.adapter.served_robot.Robot``."""

    def __init__(self, access: Access) -> None:
        self._access = access
        self._reading, self._stopped = threading.Lock(), threading.Event()
        self._said: list[str] = []
        self._shown: list[str] = []
        self._restoring = ""
        self._is_connected = self._is_ours = False
        self._coordinates = _AXES

    def hello(self, told: Told) -> Told:
        """Connect; older messages are none of this client's."""
        self._coordinates = told.get("coordinates", _AXES)
        found = self._access.connect(told)
        self._is_connected = True
        self._take_messages()
        self._shown.clear()
        return found

    def status(self) -> Told:
        """Its state; error messages are those since it was on."""
        known = len(self._shown)
        state = self._access.state()
        # In this order: an emergency stop between the two is not taken for a machine that was switched off.
        is_on, estop = state.is_on, state.estop
        if is_on and not estop:
            del self._shown[:known]
        else:
            self._read_messages()
        return {
            "estop": estop,
            "enabled": is_on,
            "homed": state.is_homed,
            "remote": not state.runs_program,
            "moving": is_on and not state.is_at_rest,
            "errors": self._shown[-MOST_SHOWN:],
            "heartbeat": " ".join(f"{value:.6f}" for value in state.joints),
        }

    def position(self) -> Told:
        """The actual pose and joints, mm and deg; before it is homed both may be those of home."""
        state = self._access.state()
        if not state.is_homed:
            return {"pose": None, "joints": None}
        joints = list(state.joints)[: len(self._coordinates)]
        return {"pose": self._own(state.pose), "joints": joints}

    def start_up(self, action: str) -> None:
        """Do it, and wait until it is so; ``check`` takes control, and requires its own coordinates."""
        if action == "check":
            self._access.claim()
            require_own_coordinates(self._access.state())
            return
        self._stopped.clear()
        self._is_ours = False  # it leaves MDI mode by itself
        self._take_messages()
        match action:
            case "reset-estop":
                self._switched(Order.ESTOP_OFF, lambda state: not state.estop)
            case "switch-on":
                self._switched(Order.MACHINE_ON, lambda state: state.is_on)
            case "switch-off":
                self._switched(Order.MACHINE_OFF, lambda state: not state.is_on)
            case "home":
                self._home()

    def move(self, pose: Sequence[float], duration_s: float, report: Report) -> None:
        """Move by one block in inverse time; the modes are then what they were."""
        self._stopped.clear()
        was_ours, self._is_ours = self._is_ours, False
        state = self._access.state()
        if not (state.is_on and state.is_homed):
            raise FailedError("refused", "it is switched off or not homed")
        require_own_coordinates(state)
        if was_ours and state.mode != MDI:
            raise foreign_mode(state)
        if state.mode != MDI:
            self._enter_mdi_mode()
        self._take_messages()
        self._restoring = self._restoring or gcode.restoring_block(state.codes)
        self._access.begin(gcode.timed_move(pose, duration_s, self._coordinates))
        try:
            state = self._until(lambda now: self._access.is_over(now, self._whole(pose, now)), report)
            if not state.is_at(self._whole(pose, state)):
                raise self._failure(state)
        finally:
            with suppress(FailedError):  # what is not restored now is restored after a later move
                self._restore_modes()
        self._is_ours = True

    def _own(self, pose: Sequence[float]) -> list[float]:
        """Those coordinates of a pose that the robot has."""
        return [value for axis, value in zip(_AXES, pose, strict=True) if axis in self._coordinates]

    def _whole(self, coordinates: Sequence[float], state: State) -> list[float]:
        """All coordinates of a pose: those that the robot does not have are as they are."""
        if self._coordinates == _AXES:
            return list(coordinates)
        given = dict(zip(self._coordinates, coordinates, strict=True))
        return [given.get(axis, value) for axis, value in zip(_AXES, state.pose, strict=True)]

    def stop(self) -> None:
        """Abort what goes on; returns at rest."""
        self._stopped.set()
        if self._is_connected:
            self._access.abort()

    def _home(self) -> None:
        """Home in joint mode; after an earlier homing it is in teleoperation mode."""
        require_own_coordinates(self._access.state())
        self._switched(Order.MANUAL, lambda state: state.mode == "manual")
        self._switched(Order.TELEOP_OFF, lambda state: not state.is_teleop)
        self._require_not_stopped()
        is_accepted = self._access.order(Order.HOME)
        if not (is_accepted and self._until(lambda state: state.is_homed or self._has_said()).is_homed):
            said = self._take_messages() or self._reason(self._access.state())
            raise FailedError("fault", f"is not homed: {said}", action="Home it at the machine")
        self._enter_mdi_mode()

    def _enter_mdi_mode(self) -> None:
        self._switched(Order.MDI, lambda state: state.mode == MDI)

    def _switched(self, order: Order, is_so: Callable[[State], bool]) -> None:
        """Have it switched, unless it is so; again where that has no effect, as while homing ends."""
        said = ""
        for _ in range(MOST_REQUESTS):
            if is_so(self._access.state()):
                return
            if self._access.order(order) and self._wait(is_so, SWITCH_S):
                return
            if said := self._take_messages():
                break
        problem = f"'{order.value}' has no effect: {said or self._reason(self._access.state())}"
        raise FailedError("fault", problem, action="Look for a message on the controller's own screen")

    def _wait(self, is_so: Callable[[State], bool], limit_s: float) -> bool:
        deadline = time.monotonic() + limit_s
        while not is_so(self._access.state()):
            if time.monotonic() > deadline:
                return False
            time.sleep(self._access.poll_s)
        return True

    def _until(self, is_so: Callable[[State], bool], report: Report | None = None) -> State:
        """The state when something that moves is over; who asked for it knows how long that may take."""
        reported = time.monotonic()
        while not is_so(state := self._access.state()):
            self._require_not_stopped()
            if not state.is_on:
                raise self._failure(state)
            if report is not None and time.monotonic() > reported + REPORT_S:
                reported = time.monotonic()
                report(self._own(state.pose))
            time.sleep(self._access.poll_s)
        return state

    def _require_not_stopped(self) -> None:
        if self._stopped.is_set():
            raise FailedError("interrupted", "it was stopped on request")

    def _failure(self, state: State) -> FailedError:
        """Why it did not reach its target, by its messages, which may come after its end, or its state."""
        deadline = time.monotonic() + MESSAGE_S
        while not self._has_said() and time.monotonic() < deadline:
            time.sleep(self._access.poll_s)
        said = self._take_messages()
        if refused := gcode.parse_pose_refusal(said):
            return FailedError("pose", said, axis=refused[0], highest=refused[1])
        if self._stopped.is_set():
            return FailedError("interrupted", "it was stopped on request")
        if not said and state.is_on and state.mode != MDI:
            return FailedError("interrupted", str(foreign_mode(state)), action=ALONE)
        # Another client, as a screen, may have taken the message that says why.
        kind = "refused" if self._access.is_refused and state.is_on else "interrupted"
        return FailedError(kind, said or self._reason(state))

    def _reason(self, state: State) -> str:
        """Why it does nothing where it says nothing."""
        if state.estop:
            return "it is in emergency stop"
        return "it is on, and gives no reason" if state.is_on else "it is switched off"

    def _restore_modes(self) -> None:
        """Restore units, motion and feed mode, where that is possible now."""
        state = self._access.state()
        if state.is_on and state.mode == MDI and self._wait(lambda now: now.is_at_rest, REST_S):
            self._access.begin(self._restoring)
            if self._wait(self._access.is_over, SWITCH_S) and not self._has_said():
                self._restoring = ""

    def _read_messages(self) -> None:
        with self._reading:
            found = [text.strip() for text in self._access.messages()]
            for unused in (self._said, self._shown):
                unused.extend(found)
                del unused[:-MOST_MESSAGES]

    def _has_said(self) -> bool:
        self._read_messages()
        return bool(self._said)

    def _take_messages(self) -> str:
        """What it has said that no order has used yet; each once."""
        self._read_messages()
        said, self._said = dict.fromkeys(self._said), []
        more = len(said) - MOST_SHOWN
        return "; ".join([*list(said)[:MOST_SHOWN], *([f"and {more} more"] if more > 0 else [])])
