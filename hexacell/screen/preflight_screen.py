"""The screen of everything that must hold before motion, and of what the plan gives."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType

from hexacell.screen.backend import WITH_LENGTH, Backend
from hexacell.screen.tab_screen import TabScreen
from hexacell.screen.widgets.text_panel import TextList, TextPanel
from hexacell.text.screens.lines import checklist_lines


class PreflightScreen(TabScreen):
    """The checklist above, the plan below."""

    TAB = "preflight"
    AUTO_FOCUS = "#checklist"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "app.perform('check')", "Look at everything", show=False),
        Binding("v", "app.perform('preview')", "Try the plan", show=False),
        Binding("x", "app.plan", "Planned poses, and exclusions", show=False),
        Binding("s", "app.perform('start', 'optimise')", "Start a calibration", show=False),
        Binding("k", "app.perform('start', 'check')", "Start a check", show=False),
        Binding("K", "app.perform('start', 'quick')", "Start a quick level", show=False),
        Binding("l", "app.perform('start', 'length')", "Start a length check", show=False),
        Binding("L", f"app.perform('start', '{WITH_LENGTH}')", "Calibrate, check the length", show=False),
        Binding("r", "app.perform('start', 'resume')", "Resume the latest run", show=False),
    ]

    def compose_body(self) -> ComposeResult:
        """See the class."""
        yield TextPanel(id="instruction", classes="instruction")
        yield TextPanel("What must hold before the robot moves", classes="title")
        yield TextList(id="checklist")
        yield TextPanel("The plan", classes="title")
        yield TextList(id="plan")

    def draw_body(self, backend: Backend) -> None:
        """Show the checklist."""
        view = backend.checklist()
        self.query_one("#instruction", TextPanel).show(view.instruction)
        lines = [line for item in view.items for line in checklist_lines(item)]
        self.query_one("#checklist", TextList).show(lines)
        self.query_one("#plan", TextList).show(view.plan)
