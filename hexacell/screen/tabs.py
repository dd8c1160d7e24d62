"""The five screens, each of which draws views of the model, and three beside them.

Beside them are gauges in large figures, the planned poses, and the first-time assistant.
"""

from __future__ import annotations

import asyncio
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import Screen
from textual.widgets import Digits, Input

from hexacell.screen import widgets
from hexacell.screen.preferences import WITH_LENGTH
from hexacell.text.screens.views import Urgency

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel
    from hexacell.text.screens.first_questions import FirstCellAssistant

GAUGES = 3

WHAT_TO_PRESS = (
    "x excludes the chosen pose or point in the cell file; on a line with OUT it removes that. "
    "v tries the plan again, Escape goes back."
)


class TabScreen(Screen[None]):
    """One of the five screens; drawn ten times a second while it is in front."""

    TAB: ClassVar[str]

    def __init__(self, keys: Mapping[str, str]) -> None:
        super().__init__()
        self._keys = keys

    def compose(self) -> ComposeResult:
        """The first lines, what is its own, and the footer."""
        yield widgets.TopLine()
        yield widgets.TabLine(self.TAB, self._keys)
        yield from self._parts()
        yield widgets.KeyLine(self._keys)

    @abstractmethod
    def _parts(self) -> ComposeResult: ...

    def draw(self, model: ScreenModel) -> None:
        """Show what is so now."""
        self.query_one(widgets.TopLine).show(*model.header())
        widgets.show_parts(self, model, self.TAB)
        self.query_one(widgets.KeyLine).show(model.allows)


class CellScreen(TabScreen):
    """Devices above, the file below."""

    TAB = "cell"
    AUTO_FOCUS = "#settings"

    def _parts(self) -> ComposeResult:
        yield widgets.TextPanel("Devices, as they show now", classes="title")
        yield widgets.DevicePanel(id="devices")
        yield widgets.TextPanel("Cell file", id="settings-title", classes="title")
        yield widgets.TextList(id="settings")


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

    def _parts(self) -> ComposeResult:
        yield widgets.TextPanel(id="instruction", classes="instruction")
        yield widgets.TextPanel("What must hold before the robot moves", classes="title")
        yield widgets.TextList(id="checklist")
        yield widgets.TextPanel("The plan", classes="title")
        yield widgets.TextList(id="plan")


RECORDS_HEADER = f"{'point/pose':12}{'x':>8}{'y':>8}{'z':>8}{'residual':>9}{'sigma':>6}"
"""The residual is the largest of x, y and z; sigma its ratio to noise."""


class MeasureScreen(TabScreen):
    """Guidance above, the devices, and below the records beside the predicted accuracy."""

    TAB = "measure"
    AUTO_FOCUS = "#records"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "app.perform('play')", "Play or halt", show=False, priority=True),
        Binding("plus", "app.perform('play', '+')", "Faster", show=False),
        Binding("minus", "app.perform('play', '-')", "Slower", show=False),
        Binding("right", "app.perform('step', '1')", "One event on", show=False, priority=True),
        Binding("left", "app.perform('step', '-1')", "One event back", show=False, priority=True),
        Binding("pagedown", "app.perform('step', '100')", "A hundred on", show=False, priority=True),
        Binding("pageup", "app.perform('step', '-100')", "A hundred back", show=False, priority=True),
        Binding("home", "app.perform('step', 'first')", "To the beginning", show=False, priority=True),
        Binding("end", "app.perform('step', 'last')", "To the end", show=False, priority=True),
    ]

    def _parts(self) -> ComposeResult:
        yield widgets.GuidancePanel(id="guidance")
        yield widgets.TextPanel("Devices", id="devices-title", classes="title")
        yield widgets.DevicePanel(id="devices")
        with Horizontal(id="lower"):
            with Vertical(id="record-side"):
                yield widgets.TextPanel(
                    "Records: deviation and residual, mm", id="records-title", classes="title"
                )
                yield widgets.TextPanel(RECORDS_HEADER, id="records-header", classes="table-header")
                yield widgets.TextList(id="records", follows=True)
            yield widgets.PlotPanel(id="accuracy")


PLOTS = 3


class ReviewScreen(TabScreen):
    """The verdict stays in sight; the rest scrolls below it."""

    TAB = "review"
    AUTO_FOCUS = "#details"

    def _parts(self) -> ComposeResult:
        yield widgets.TextPanel(id="verdict")
        yield widgets.TextPanel(id="scope")
        yield widgets.TextPanel(id="approval")
        with VerticalScroll(id="details"):
            yield widgets.TextPanel("Held-out poses, before and after", classes="title")
            yield widgets.TextPanel(id="comparison")
            with Horizontal(id="plots"):
                for number in range(PLOTS):
                    yield widgets.PlotPanel(id=f"plot-{number}", classes="plot")
            with Vertical():
                yield widgets.TextPanel("Parameters", classes="title")
                yield widgets.TextPanel(id="parameters-header", classes="table-header")
                yield widgets.TextPanel(id="parameters")
                yield widgets.TextPanel("The change of the controller's config", classes="title")
                yield widgets.TextPanel(id="change")


class HistoryScreen(TabScreen):
    """The runs above, what was asked about one of them below."""

    TAB = "history"
    AUTO_FOCUS = "#runs"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("v", "about('compare')", "Compare with the one before", show=False),
        Binding("b", "about('roll back')", "Go back to its config, or undo it", show=False),
        Binding("w", "write", "Write its proposal", show=False),
        Binding("o", "app.perform('drift')", "Drift over all runs", show=False),
    ]

    is_asked = False

    def _parts(self) -> ComposeResult:
        yield widgets.TextPanel(id="history-header", classes="table-header")
        yield widgets.RowList(id="runs")
        yield widgets.TextPanel("Comparison", classes="title")
        yield widgets.TextList(id="comparison")

    def draw(self, model: ScreenModel) -> None:
        """Show what is so now."""
        self.is_asked = model.question() is not None
        super().draw(model)

    async def action_about(self, what: str) -> None:
        """Do something about the run that is chosen."""
        if (run := self.query_one(widgets.RowList).chosen) is not None:
            await self.run_action(f"app.perform({what!r}, {run!r})")

    async def action_write(self) -> None:
        """Write the proposal of the chosen run; a question that waits comes first, as on every screen."""
        if self.is_asked:
            await self.run_action("app.answer")
        else:
            await self.action_about("apply")

    async def on_option_list_option_selected(self) -> None:
        """Open the run."""
        await self.action_about("open")


class DigitsScreen(Screen[None]):
    """Deviation of each gauge where there is a zero, else its reading."""

    BINDINGS: ClassVar[list[BindingType]] = [("d,escape,enter", "dismiss", "Back")]
    _records = -1

    def compose(self) -> ComposeResult:
        """What happens now, and three figures."""
        yield widgets.TextPanel(id="digits-now")
        for number in range(GAUGES):
            yield Digits(id=f"digits-{number}", classes="digits")
        yield widgets.TextPanel(
            "mm, deviation from the reference where there is one. d or Escape goes back."
        )

    def draw(self, model: ScreenModel) -> None:
        """Show the gauges."""
        now, figures, records = model.figures()
        self.query_one("#digits-now", widgets.TextPanel).show(now)
        for number, (figure, urgency) in enumerate(figures[:GAUGES]):
            digits = self.query_one(f"#digits-{number}", Digits)
            digits.update(figure)
            digits.set_class(urgency is Urgency.ALARM, "urgency-alarm")
        if self._records not in {-1, records}:
            self.app.bell()
        self._records = records


class PlanScreen(Screen[None]):
    """Exclusions above, the planned poses below."""

    AUTO_FOCUS = "#poses"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("x,space,delete", "exclude", "Exclude, or remove the exclusion", show=False),
        Binding("v", "app.perform('preview')", "Try the plan", show=False),
        Binding("escape", "dismiss", "Back", show=False),
    ]

    def compose(self) -> ComposeResult:
        """The parts of this screen."""
        yield widgets.TextPanel("The poses of the plan", classes="title")
        yield widgets.TextPanel(id="plan-note", classes="instruction")
        yield widgets.RowList(id="poses")
        yield widgets.TextPanel(WHAT_TO_PRESS, id="plan-hint", classes="hint")

    def draw(self, model: ScreenModel) -> None:
        """Show the poses."""
        widgets.show_parts(self, model, "plan")

    async def on_option_list_option_selected(self) -> None:
        """Enter does the same."""
        await self.action_exclude()

    async def action_exclude(self) -> None:
        """Exclude what is chosen, or remove that exclusion."""
        if (name := self.query_one(widgets.RowList).chosen) is not None:
            await self.run_action(f"app.perform('exclude', {name!r})")


class AssistantScreen(Screen[bool]):
    """Gives whether the cell file was made."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("escape", "back", "The question before"),
        ("ctrl+q", "dismiss(False)", "Quit without a file"),
    ]
    AUTO_FOCUS = "Input"

    def __init__(self, assistant: FirstCellAssistant, path: Path) -> None:
        super().__init__()
        self._assistant, self._path = assistant, path

    def compose(self) -> ComposeResult:
        """One question, a field, and what is wrong with the answer."""
        yield widgets.TextPanel(
            f"hexacell | There is no {self._path.name} yet. Some questions lead to it.", id="where"
        )
        with Vertical(id="assistant"):
            yield widgets.TextPanel(id="progress", classes="title")
            yield widgets.TextPanel(id="first-question")
            yield widgets.TextPanel(id="first-hint", classes="hint")
            yield Input(id="first-answer", compact=True)
            yield widgets.TextPanel(id="first-problem")
            yield widgets.TextPanel(
                "Enter takes the answer, Escape goes back to the one before, ctrl+q quits without a file.",
                classes="hint",
            )

    def on_mount(self) -> None:
        """Ask the first question."""
        self.query_one(Input).cursor_blink = False
        self._show()

    async def on_input_submitted(self, event: Input.Submitted) -> None:
        """Take the answer; in a thread, as the last one takes a second."""
        await asyncio.to_thread(self._assistant.answer, event.value)
        if self._assistant.is_done:
            self.dismiss(True)
        else:
            self._show()

    def action_back(self) -> None:
        """Return to the question before."""
        self._assistant.back()
        self._show()

    def _show(self) -> None:
        assistant, field = self._assistant, self.query_one(Input)
        text, hint = assistant.question
        self.query_one("#progress", widgets.TextPanel).show(assistant.progress)
        self.query_one("#first-question", widgets.TextPanel).show(text)
        self.query_one("#first-hint", widgets.TextPanel).show(hint)
        self.query_one("#first-problem", widgets.TextPanel).show(assistant.problem, Urgency.ALARM)
        if not assistant.problem:
            field.value = assistant.suggestion
            field.cursor_position = len(field.value)
