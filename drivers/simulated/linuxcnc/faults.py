"""Faults of the simulated controller."""

from __future__ import annotations

import math
import threading
from enum import Enum, auto


class ControllerFault(Enum):
    """A fault, and the occasion that triggers it."""

    SILENT = auto()
    """A line gets no response."""
    REFUSES_PASSWORD = auto()
    """A greeting gets NAK."""
    REFUSES_MOVE = auto()
    """A move gets NAK, with an error message."""
    DOES_NOT_MOVE = auto()
    """A move is acknowledged but not executed."""
    DROPS_CONNECTION = auto()
    """During a move its connection is cut; the machine continues."""
    EMERGENCY_STOP = auto()
    """The emergency stop is pressed during a move."""
    FOLLOWING_ERROR = auto()
    """A slider exceeds its following error during a move: the machine is switched off."""


class ControllerFaults:
    """The active faults, each for a number of occasions. Thread-safe."""

    def __init__(self) -> None:
        self._left: dict[ControllerFault, float] = {}
        self._lock = threading.Lock()

    def inject(self, fault: ControllerFault, times: float = math.inf) -> None:
        """Activate ``fault`` for the next ``times`` occasions."""
        with self._lock:
            self._left[fault] = times

    def clear(self, fault: ControllerFault) -> None:
        """Deactivate ``fault``."""
        with self._lock:
            self._left.pop(fault, None)

    def triggers(self, fault: ControllerFault) -> bool:
        """Whether ``fault`` is active on this occasion, which is counted."""
        with self._lock:
            left = self._left.get(fault, 0)
            self._left[fault] = left - 1
            return left > 0
