"""A simulated dial indicator, whose settings depend on no protocol."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign

MM_PER_INCH = 25.4
PUSH_MM = 6.0
OFF_MIDDLE_MM = 3.8

PlungerPosition = Callable[[], float]
"""The plunger position now, mm from the middle of its travel, with noise.

Called from the thread of the line.
"""


class Indicator:
    """One instrument. Its settings and its power are attributes.

    ``held_mm`` is the value on hold, ``peak_mm`` the largest one while it shows that.
    """

    def __init__(self, plunger: PlungerPosition, travel_mm: float = 12.5) -> None:
        self.inch = False
        self.reversed = False
        self.battery_low = False
        self.preset_mm = 0.0
        self.powered = True
        self.held_mm: float | None = None
        self._plunger = plunger
        self._travel_mm = travel_mm
        self._offset_mm = 0.0
        self._at_end = False
        self._jammed_mm: float | None = None
        self.peak_mm: float | None = None
        self._pushed_mm = 0.0
        self._off_middle_mm = 0.0

    def shown(self) -> float | None:
        """The number on the display, mm or inch; None with the plunger at an end of its travel."""
        value = self._live_mm() if self.held_mm is None else self.held_mm
        if value is None:
            return None
        if self.peak_mm is not None:
            value = self.peak_mm = max(self.peak_mm, value)
        return value / MM_PER_INCH if self.inch else value

    def set_hold(self, *, on: bool) -> None:
        """Hold the display, without effect at an end of the travel; or end the hold."""
        self.held_mm = self._live_mm() if on else None

    def set_peak(self, *, on: bool) -> None:
        """Show the largest value since then, or the present one again."""
        self.peak_mm = self._live_mm() if on else None

    def set_battery_low(self, *, on: bool) -> None:
        """Report a low battery, or a good one."""
        self.battery_low = on

    def set_zeroed(self, *, on: bool) -> None:
        """Press the zero key; what it did stays."""
        if on:
            self.recall_preset()

    def recall_preset(self) -> None:
        """Set the display to the preset value; with a preset of 0 this is the zero key."""
        self._offset_mm += self.preset_mm - (self._live_mm() or 0.0)

    def switch_on(self) -> None:
        """Switch on: no hold, and the zero at the present plunger position."""
        self.powered = True
        self.set_hold(on=False)
        self._offset_mm = 0.0
        self._offset_mm = -(self._live_mm() or 0.0)

    def set_at_end(self, *, on: bool) -> None:
        """Move the plunger to an end of its travel, or back."""
        self._at_end = on

    def set_frozen(self, *, on: bool) -> None:
        """Jam the plunger at its position, or free it; the instrument still answers."""
        self._jammed_mm = self._plunger() if on else None

    def set_pushed(self, *, on: bool) -> None:
        """Push the plunger farther than a ball on its plate could, or release it."""
        self._pushed_mm = -copysign(PUSH_MM, self._plunger()) if on else 0.0

    def set_reversed(self, *, on: bool) -> None:
        """Count in the other direction, or as it should."""
        self.reversed = on

    def set_inch(self, *, on: bool) -> None:
        """Show inches, or mm."""
        self.inch = on

    def exchange_with(self, other: Indicator) -> None:
        """Put each of two instruments where the other one is."""
        self._plunger, other._plunger = other._plunger, self._plunger

    def set_off_middle(self, *, on: bool) -> None:
        """Clamp the instrument by its stem so far from where it belongs, or as it belongs."""
        self._off_middle_mm = OFF_MIDDLE_MM if on else 0.0

    def _live_mm(self) -> float | None:
        free = self._plunger() + self._off_middle_mm + self._pushed_mm
        position = free if self._jammed_mm is None else self._jammed_mm
        if self._at_end or abs(position) > self._travel_mm / 2:
            return None
        return (-position if self.reversed else position) + self._offset_mm
