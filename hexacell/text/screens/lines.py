"""Views as lines of fixed width, and figures large enough to be read across a room."""

from __future__ import annotations

from hexacell.text.screens.views import (
    ChecklistItem,
    DeviceLine,
    GaugeReadout,
    LiveView,
    Mark,
    Urgency,
)

NEVER = "never"
"""The age of what has not answered yet."""

ROWS = 5
"""Height of a figure in rows, at scale 1."""

_SHAPES = {
    "0": ("###", "# #", "# #", "# #", "###"),
    "1": (" # ", "## ", " # ", " # ", "###"),
    "2": ("###", "  #", "###", "#  ", "###"),
    "3": ("###", "  #", "###", "  #", "###"),
    "4": ("# #", "# #", "###", "  #", "  #"),
    "5": ("###", "#  ", "###", "  #", "###"),
    "6": ("###", "#  ", "###", "# #", "###"),
    "7": ("###", "  #", "  #", "  #", "  #"),
    "8": ("###", "# #", "###", "# #", "###"),
    "9": ("###", "# #", "###", "  #", "###"),
    "+": ("   ", " # ", "###", " # ", "   "),
    "-": ("   ", "   ", "###", "   ", "   "),
    ".": (" ", " ", " ", " ", "#"),
    "x": ("   ", "# #", " # ", "# #", "   "),
    "y": ("   ", "# #", "###", "  #", "## "),
    "z": ("   ", "###", " # ", "#  ", "###"),
    " ": (" ", " ", " ", " ", " "),
}


def device_lines(live: LiveView, *, for_mounting: bool = False) -> list[tuple[str, Urgency]]:
    """A line for each device, and how urgent it is."""
    if live.note:
        return [(live.note, Urgency.CALM)]
    gauges = [(gauge_line(one, for_mounting=for_mounting), one.urgency) for one in live.gauges]
    others = [] if for_mounting else [(other_line(one), one.urgency) for one in live.devices]
    return [*gauges, *others]


def gauge_line(gauge: GaugeReadout, *, for_mounting: bool = False) -> str:
    """A gauge in at most 80 columns, or why it does not answer."""
    name = gauge.name if gauge.name == gauge.axis else f"{gauge.name} ({gauge.axis})"
    if gauge.problem:
        since = "" if gauge.age == NEVER else f" for {gauge.age}"
        return f"{name:4}NO READING{since}: {gauge.problem}"
    start = f"{name:4}{gauge.reading:>9} {gauge.unit}"
    if for_mounting:
        return f"{start}  {gauge.bar}  {gauge.advice}"
    deviation = f"  d {gauge.deviation:>7}" if gauge.deviation else " " * 11
    return f"{start}{deviation}{gauge.age:>7}{gauge.noise:>9} {gauge.bar} {gauge.place}"


def other_line(device: DeviceLine) -> str:
    """The encoders, the controller, or the stop line."""
    return f"{device.name:11}{device.text}"


def checklist_lines(item: ChecklistItem) -> list[str]:
    """An item of a checklist: how it stands, and below it what to do."""
    finding = f": {item.finding}" if item.finding else ""
    lines = [f"{item.mark}  {item.name}{finding}"]
    return [*lines, f"    -> {item.action}"] if item.action and item.mark is Mark.FAILED else lines


def block_text(text: str, scale: int = 1) -> list[str]:
    """A short text of figures, signs and axes in lines of blocks; anything else is left blank.

    A point of a figure is ``2 * scale`` columns wide and ``scale`` rows high.
    """
    shapes = [_SHAPES.get(letter, _SHAPES[" "]) for letter in text]
    rows = [" ".join(shape[row] for shape in shapes) for row in range(ROWS)]
    wide = ["".join(("█" if cell == "#" else " ") * 2 * scale for cell in row).rstrip() for row in rows]
    return [row for row in wide for _ in range(scale)]
