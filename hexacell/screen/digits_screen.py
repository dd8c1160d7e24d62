"""The three gauges in figures that are read across a room; the bell rings with each record."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.screen import Screen

from hexacell.screen.backend import Backend
from hexacell.screen.widgets.text_panel import TextPanel
from hexacell.text.screens.block_digits import ROWS, block_text
from hexacell.text.screens.views import GaugeReadout

GAUGES = 3
OTHER_ROWS = 5
"""For guidance and spaces."""


class DigitsScreen(Screen[None]):
    """Deviation of each gauge where there is a zero, else its reading."""

    BINDINGS: ClassVar[list[BindingType]] = [("d,escape,enter", "dismiss", "Back")]
    _records = -1

    def compose(self) -> ComposeResult:
        """What happens now, and three figures."""
        yield TextPanel(id="digits-now")
        for number in range(GAUGES):
            yield TextPanel(id=f"digits-{number}", classes="digits")
        yield TextPanel("mm, deviation from the reference where there is one. d or Escape goes back.")

    def draw(self, backend: Backend) -> None:
        """Show the gauges."""
        view = backend.measure()
        self.query_one("#digits-now", TextPanel).show(view.guidance.now)
        scale = 2 if self.size.height >= 2 * GAUGES * ROWS + OTHER_ROWS and self.size.width >= 120 else 1
        for number, gauge in enumerate(view.live.gauges[:GAUGES]):
            text = "\n".join(block_text(_figure(gauge), scale))
            self.query_one(f"#digits-{number}", TextPanel).show(text or gauge.problem, gauge.urgency)
        if self._records not in {-1, len(view.records)}:
            self.app.bell()
        self._records = len(view.records)


def _figure(gauge: GaugeReadout) -> str:
    if gauge.problem:
        return f"{gauge.axis} - - -"
    return f"{gauge.axis} {gauge.deviation or gauge.reading[:-1]}"
