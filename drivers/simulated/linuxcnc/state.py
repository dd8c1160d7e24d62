"""The state of the simulated controller, shared by all clients, and the effects of commands on it.

Names and messages are LinuxCNC's: task state, mode, teleoperation, and a queue of operator errors.
All commands but MDI blocks are acknowledged even without effect.
"""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from enum import Enum
from typing import Protocol

from drivers.simulated.linuxcnc.mdi import BlockError, ModalState, parse_block
from hexacell.errors import HexacellError
from hexacell.kinematics.pose import Pose

FAULTY_JOINT = 3
"""The joint with simulated following errors, counted from 0 as in LinuxCNC."""

_RETRY_S = 0.05


class TaskMode(Enum):
    """The task mode."""

    MANUAL = "MANUAL"
    AUTO = "AUTO"
    MDI = "MDI"


class ConnectionCut(Exception):
    """The connection of the command must be cut."""


class MotionRefused(Exception):
    """The target is beyond a soft limit or out of reach, in the words of LinuxCNC; nothing moves."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"Linear move on line 0 {reason}")


class Machine(Protocol):
    """The machine behind the controller, called from several threads.

    ``move`` and ``home`` return when that has ended or was stopped; meanwhile, any other method may be
    called from another thread. ``move`` takes no less than ``duration_s``, or raises ``MotionRefused``.
    The geometry is read by ``switch_on`` only; if it raises ``HexacellError``, the machine stays off.
    """

    def move(self, pose: Pose, duration_s: float | None) -> None: ...

    def stop(self) -> None: ...

    def pose(self) -> Pose: ...

    def joints(self) -> tuple[float, ...]: ...

    def switch_on(self) -> None: ...

    def home(self) -> None: ...


class ControllerState:
    """The controller of one machine; a thread of its own executes motions one after another.

    ``waits``: MDI blocks are acknowledged when they are done, not when they are received.
    """

    def __init__(self, machine: Machine) -> None:
        self.estop = True
        self.enabled = False
        self.mode = TaskMode.MANUAL
        self.teleop = False
        self.homed = False
        self.waits = False
        self.modes = ModalState()
        self.feed_override_percent = 100.0
        self.commander: object | None = None
        self.machine = machine
        self._errors: deque[str] = deque()
        self._jobs: list[Future[bool]] = []
        self._abort_count = 0
        self._closed = False
        self._lock = threading.RLock()
        self._motion = ThreadPoolExecutor(1, thread_name_prefix="simulated motion")

    def close(self) -> None:
        with self._lock:
            self._closed = True
        self.abort()
        while wait(self._jobs, timeout=_RETRY_S).not_done:  # a motion may have started just now
            self.abort()
        self._motion.shutdown()

    def next_error(self) -> str:
        """Remove and return the oldest operator error; OK if there is none."""
        return self._errors.popleft() if self._errors else "OK"

    def set_estop(self, *, on: bool) -> None:
        """Enter or leave emergency stop; entering switches the machine off."""
        with self._lock:
            if on:
                self._switch_off()
            self.estop = on

    def exceed_following_error(self) -> None:
        """A joint exceeds its following error: the machine is switched off, with an error message."""
        with self._lock:
            self._errors.append(f"joint {FAULTY_JOINT} following error")
            self._switch_off()

    def set_machine(self, *, on: bool) -> None:
        """Switch on or off; in emergency stop this is acknowledged without effect."""
        with self._lock:
            if not on:
                self._switch_off()
            elif not self.estop and not self.enabled:
                try:
                    self.machine.switch_on()
                except HexacellError as error:
                    self._errors.append(str(error))
                else:
                    self.enabled = True

    def set_mode(self, mode: TaskMode) -> None:
        """Change mode; MDI before homing is acknowledged without effect."""
        if mode is not TaskMode.MANUAL and not self.homed:
            self._errors.append("all joints must be homed before going into coordinated mode")
            return
        self.mode = mode
        self.teleop = mode is TaskMode.MANUAL and self.homed

    def home(self) -> None:
        """Start homing; acknowledged at once, without effect outside joint mode."""
        if self.mode is not TaskMode.MANUAL:
            self._errors.append("can't do that (EMC_JOINT_HOME:123) in MDI mode")
        elif self.teleop:
            self._errors.append("must be in joint mode to home")
        else:
            self._start(self._home)

    def abort(self) -> None:
        """Stop the motion in place; waiting blocks are dropped."""
        with self._lock:
            self._abort_count += 1
            for job in self._jobs:
                job.cancel()
            self.machine.stop()

    def mdi(self, block: str) -> bool:
        """Carry out one block; returns when it has ended if commands are acknowledged then.

        Raises:
            ConnectionCut: The controller is being closed.
        """
        try:
            parsed = parse_block(block, self.machine.pose(), self.modes)
            self._require_mdi()
        except BlockError as error:
            self._errors.append(str(error))
            return not self.waits
        self.modes = parsed.modes
        if (target := parsed.target) is None:
            return True
        if (duration_s := parsed.duration_s) is not None:
            duration_s *= 100.0 / self.feed_override_percent
        job = self.travel(target, duration_s)
        if not self.waits:
            return True
        with suppress(CancelledError):
            return job.result()
        return True  # an aborted motion succeeds, as in LinuxCNC

    def travel(self, target: Pose, duration_s: float | None) -> Future[bool]:
        """Start to move; whether it was not refused, once it has ended or was stopped."""
        return self._start(lambda: self._travel(target, duration_s))

    @property
    def is_moving(self) -> bool:
        """Whether a motion has begun, or waits, and has not ended."""
        return any(not job.done() for job in self._jobs)

    @property
    def stop_count(self) -> int:
        """How often motion was stopped."""
        return self._abort_count

    def _require_mdi(self) -> None:
        if not self.homed:
            raise BlockError("Can't issue MDI command when not homed")
        if self.mode is not TaskMode.MDI:
            raise BlockError("Must be in MDI mode to issue MDI command")

    def _start(self, motion: Callable[[], bool]) -> Future[bool]:
        with self._lock:
            if self._closed:
                raise ConnectionCut
            job = self._motion.submit(motion)
            self._jobs = [other for other in self._jobs if not other.done()] + [job]
            return job

    def _travel(self, target: Pose, duration_s: float | None) -> bool:
        try:
            self.machine.move(target, duration_s)
        except MotionRefused as refusal:
            self._errors.extend((str(refusal), "invalid params in linear command"))
            return False
        except HexacellError as error:
            self._errors.append(str(error))
            return False
        return True

    def _home(self) -> bool:
        stops = self._abort_count
        self.machine.home()
        self.homed = self._abort_count == stops
        return self.homed

    def _switch_off(self) -> None:
        self.abort()
        self.enabled = False
