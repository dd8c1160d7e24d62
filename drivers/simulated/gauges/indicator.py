"""A dial indicator behind its display: what it measures and how it is set, whatever its protocol."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign

MM_PER_INCH = 25.4
PUSH_MM = 6.0

PlungerPosition = Callable[[], float]
"""Where the plunger is now, mm from the middle of its travel, noise included.

Called from the thread that serves the line.
"""


class Indicator:
    """One instrument. Its keys are the methods, its settings the attributes."""

    def __init__(self, plunger: PlungerPosition, travel_mm: float = 12.5) -> None:
        self.inch = False
        self.reversed = False
        self.battery_low = False
        self.preset_mm = 0.0
        self.powered = True
        self.at_end = False
        self._plunger = plunger
        self._travel_mm = travel_mm
        self._offset_mm = 0.0
        self._held_mm: float | None = None
        self._stuck_mm: float | None = None
        self._pushed_mm = 0.0

    @property
    def on_hold(self) -> bool:
        """Whether its display is frozen."""
        return self._held_mm is not None

    def shown(self) -> float | None:
        """The number on the display, mm or inch; None with the plunger at an end of its travel."""
        value = self._live_mm() if self._held_mm is None else self._held_mm
        if value is None:
            return None
        return value / MM_PER_INCH if self.inch else value

    def hold(self) -> None:
        """Freeze the display; nothing to freeze at an end of the travel."""
        self._held_mm = self._live_mm()

    def release(self) -> None:
        """Let the display follow the plunger again."""
        self._held_mm = None

    def jam(self, *, on: bool) -> None:
        """Let the plunger jam where it is, or come free: it goes on answering."""
        self._stuck_mm = self._plunger() if on else None

    def push(self, *, on: bool) -> None:
        """Push the plunger away, farther than a ball on its plate would, or let it come back."""
        self._pushed_mm = -copysign(PUSH_MM, self._plunger()) if on else 0.0

    def recall_preset(self) -> None:
        """Show the preset value here; with a preset of 0 this is the zero key."""
        self._offset_mm += self.preset_mm - (self._live_mm() or 0.0)

    def switch_off(self) -> None:
        """What the automatic switch-off does."""
        self.powered = False

    def switch_on(self) -> None:
        """Start anew: hold released, and the zero wherever the plunger is."""
        self.powered = True
        self.release()
        self._offset_mm = 0.0
        self._offset_mm = -(self._live_mm() or 0.0)

    def _live_mm(self) -> float | None:
        position = self._plunger() + self._pushed_mm if self._stuck_mm is None else self._stuck_mm
        if self.at_end or abs(position) > self._travel_mm / 2:
            return None
        return (-position if self.reversed else position) + self._offset_mm
