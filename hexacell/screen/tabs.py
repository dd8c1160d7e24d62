"""The five screens: cell, preflight, measure, review, history; each draws views of the model."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import Screen

from hexacell.screen import widgets
from hexacell.screen.preferences import WITH_LENGTH

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel


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
