"""The devices as they show now, a line each."""

from __future__ import annotations

from textual.containers import Vertical

from hexacell.screen.widgets.text_panel import TextPanel
from hexacell.text.screens.lines import device_lines
from hexacell.text.screens.views import LiveView

MOST_LINES = 6
"""Three gauges, encoders, controller and stop line."""


class DevicePanel(Vertical):
    """A line for each device."""

    def __init__(
        self,
        *,
        id: str | None = None,  # noqa: A002 - as in every widget
        for_mounting: bool = False,
    ) -> None:
        self._lines = [TextPanel() for _ in range(MOST_LINES)]
        self._for_mounting = for_mounting
        super().__init__(*self._lines, id=id)

    def show(self, live: LiveView) -> None:
        """Show the devices."""
        lines = device_lines(live, for_mounting=self._for_mounting)
        for number, panel in enumerate(self._lines):
            panel.display = number < len(lines)
            if panel.display:
                panel.show(*lines[number])
