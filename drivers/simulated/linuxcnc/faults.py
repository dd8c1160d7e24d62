"""What a simulated controller can be told to do wrong."""

from __future__ import annotations

import math
import threading
from enum import Enum, auto


class ControllerFault(Enum):
    """Something that goes wrong, and the occasion on which it does."""

    SILENT = auto()
    """A line is taken and not answered."""
    REFUSES_PASSWORD = auto()
    """A greeting is answered with NAK."""
    REFUSES_MOVE = auto()
    """A move is answered with NAK, and the error says why."""
    DOES_NOT_MOVE = auto()
    """A move is acknowledged and does not take place."""
    DROPS_CONNECTION = auto()
    """In the middle of a move the connection that ordered it is cut; the machine goes on."""
    EMERGENCY_STOP = auto()
    """In the middle of a move somebody presses the emergency stop."""
    FOLLOWING_ERROR = auto()
    """In the middle of a move a slider lags behind: the machine is switched off."""


class ControllerFaults:
    """The faults in force, each for so many occasions; safe to change while the server runs."""

    def __init__(self) -> None:
        self._left: dict[ControllerFault, float] = {}
        self._lock = threading.Lock()

    def inject(self, fault: ControllerFault, times: float = math.inf) -> None:
        """Let ``fault`` strike on the next ``times`` occasions."""
        with self._lock:
            self._left[fault] = times

    def clear(self, fault: ControllerFault) -> None:
        """End ``fault``."""
        with self._lock:
            self._left.pop(fault, None)

    def triggers(self, fault: ControllerFault) -> bool:
        """Whether ``fault`` strikes on the occasion that this is."""
        with self._lock:
            left = self._left.get(fault, 0)
            self._left[fault] = left - 1
            return left > 0
