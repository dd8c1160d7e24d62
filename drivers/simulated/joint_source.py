"""Joint positions that another program prints, such as ``halsampler`` of a real LinuxCNC."""

from __future__ import annotations

import subprocess
import threading
import time
from collections import deque
from collections.abc import Sequence

import numpy as np

from drivers.simulated.served_device import Closeable
from hexacell.kinematics.parameters import LEGS
from hexacell.kinematics.rotations import Array

RESTART_S = 0.5
"""Pause before the program is started again: it ends whenever the controller does."""

BACKLOG_S = 0.3
"""In which the program prints what was sampled before it was started; that is not where the joints are."""

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
        found = []
        while self._passed:
            found.append(self._passed.popleft())
        return found

    def close(self) -> None:
        """End the program; twice is harmless."""
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
    """The six numbers of a line; none if there are not six, or a seventh is 0."""
    try:
        numbers = np.array([float(word) for word in line.split()])
    except ValueError:
        return None
    if len(numbers) not in {LEGS, LEGS + 1} or not np.isfinite(numbers).all():
        return None
    return numbers[:LEGS] if numbers[LEGS:].all() else None
