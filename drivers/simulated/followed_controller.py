"""A cell with a real controller: the robot that it moves, and its gauges and encoders, are simulated."""

import json
import subprocess
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np

from drivers.simulated.cell import SimulatedSensors, simulation_of
from drivers.simulated.physics import Motion, RobotPhysics
from drivers.simulated.served_device import Closeable, ServedGroup
from hexacell.cell.model import CellSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.clock import CellClock
from hexacell.config.layout import ConfigLayout, fingerprint
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.parameters import CONSTRAINTS
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.storage.atomic_files import read_bytes, write_own

LONGEST_STEP_MM = 5.0
"""Longest step of a joint variable between two solutions of the pose: the assembly mode is kept."""
MOVED_MM = 1e-4
RESTING_S = 0.2
"""Without a change of the joints for longer, the robot stands."""
RESTART_S = 0.5
"""Pause before the program is started again: it ends whenever the controller does."""
BACKLOG_S = 0.3
"""Time, s, in which the program prints old samples, from before its start."""
KEPT = 10_000
"""Positions that nobody asked for, of which the oldest are dropped."""


class JointSource(Closeable):
    """Runs ``command`` until it is closed; each line of six numbers is where the joints are, mm.

    A seventh, if any, is 0 where they are not homed; what they are then said to be is no place.
    """

    def __init__(self, command: Sequence[str]) -> None:
        self._command = tuple(command)
        self._passed: deque[Array] = deque(maxlen=KEPT)
        self._closing = threading.Event()
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._serve, name="joint source", daemon=True)
        self._thread.start()

    def passed(self) -> list[Array]:
        """Where the joints (6,), mm, have been since the last call, in order."""
        return [self._passed.popleft() for _ in range(len(self._passed))]

    def close(self) -> None:
        with self._lock:
            self._closing.set()
            if self._process is not None:
                self._process.terminate()
        self._thread.join()

    def _serve(self) -> None:
        while not self._closing.is_set():
            self._read_until_it_ends()
            self._closing.wait(RESTART_S)

    def _read_until_it_ends(self) -> None:
        with self._lock:
            if self._closing.is_set():
                return
            self._process = subprocess.Popen(  # noqa: S603 - the owner's own command
                self._command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
        begin = time.monotonic() + BACKLOG_S
        with self._process as process:
            for line in process.stdout or ():
                if (joints := joints_in(line)) is not None and time.monotonic() > begin:
                    self._passed.append(joints)


def joints_in(line: str) -> Array | None:
    """The six numbers of a line; None if there are not six, or a seventh is 0."""
    try:
        numbers = np.array([float(word) for word in line.split()])
    except ValueError:
        return None
    if len(numbers) not in {CONSTRAINTS, CONSTRAINTS + 1} or not np.isfinite(numbers).all():
        return None
    return numbers[:CONSTRAINTS] if numbers[CONSTRAINTS:].all() else None


class FollowingPhysics(RobotPhysics):
    """Where the joints are is what ``source`` says; before it says anything, at the first point.

    Where the gauges are is kept in a file beside the controller's ``config``. It holds as long as the
    config is what it was then: with another geometry the same command leads elsewhere, and a person would
    place the gauges anew.
    """

    def __init__(self, source: JointSource, config: tuple[Path, ...], *arguments: Any) -> None:  # noqa: ANN401 - those of its base
        super().__init__(*arguments)
        self._source = source
        self._config = config
        self._kept = config[0].with_name(f".{config[0].name}.simulated-gauges")
        self._is_first = True
        self._draw_noise()

    def _update(self) -> float:
        now = self._clock.now()
        for shown in self._source.passed():
            self._follow(shown / self._shown_per_mm, now)
            if self._is_first:  # before, the ball was at the first point for want of anything better
                self._is_first = False
                with suppress(OSError, FileError, ValueError, KeyError, TypeError):
                    kept = json.loads(read_bytes(self._kept))
                    if kept["config"] == fingerprint(*self._config):
                        station, triad = np.array(kept["station"], float), np.array(kept["triad"], float)
                        self.gauges.stand(station.reshape(3), triad.reshape(3, 3))
                self.gauges.on_placed = self._keep_gauges
        self._move_platform(self._motion.path[-1])  # it may be warmer
        return now

    def _keep_gauges(self, station: Array, triad: Array) -> None:
        with suppress(FileError):  # a folder that cannot be written is no reason to have no gauges
            places = {"station": station.tolist(), "triad": triad.tolist()}
            write_own(self._kept, json.dumps({"config": fingerprint(*self._config), **places}).encode())

    def encoder_positions(self) -> Array:
        with self._lock:
            self._update()
            return super().encoder_positions()

    def _follow(self, joints: Array, now: float) -> None:
        step = joints - self._motion.path[-1]
        largest = float(np.abs(step).max())
        if largest < MOVED_MM:
            return
        if self._motion.end_s < now - RESTING_S:  # it stood, and another move begins
            self._draw_noise()
            self.on_motion_start()
        for share in np.linspace(0.0, 1.0, int(np.ceil(largest / LONGEST_STEP_MM)) + 1)[1:]:
            self._move_platform(joints - (1.0 - share) * step)
        self._motion = Motion(np.stack([joints, joints]), now, 0.0)


class FollowedController(ServedGroup):
    """Serves gauges and encoders at the joints of ``[simulation] joints_command`` until it is closed.

    Raises:
        FileError: the controller's config cannot be read.
        ReachError: the first point of the cell is out of reach by its config or its true geometry.
        UsageError: faults are stated, or a clock that is not the real one; or there is no such command.
    """

    def __init__(
        self, settings: CellSettings, config: tuple[Path, ...], *, other_processes: bool = False
    ) -> None:
        simulation, layout = simulation_of(settings), ConfigLayout.of(settings)
        _require_real(settings, simulation)
        clock = CellClock(1.0)
        home = Pose(*settings.identification.points[0])
        commanding, fixture = layout.read(*config), settings.length_check
        with ExitStack() as served:
            source = served.enter_context(JointSource(simulation.joints_command))
            self.physics = FollowingPhysics(
                source, config, settings.mechanism, simulation, clock, commanding, home, fixture
            )
            self.sensors = served.enter_context(
                SimulatedSensors(settings, self.physics, clock, other_processes=other_processes)
            )
            self._served = served.pop_all()
        self.settings = self.sensors.addressed(settings)


def _require_real(settings: CellSettings, simulation: SimulationSettings) -> None:
    if simulation.faults:
        problem, action = ("only a simulated controller has faults", "Remove [[simulation.faults]]")
    elif settings.timing.clock_factor != 1.0:
        problem, action = "a real controller has no fast clock", "Remove timing.clock_factor"
    elif which(simulation.joints_command[0]) is None:
        problem = f"there is no program '{simulation.joints_command[0]}'"
        action = "Install it, or remove [simulation]"
    else:
        return
    raise UsageError(f"[simulation] names a joints_command, but {problem}", action=action)
