"""The five screens: cell, preflight, measure, review, history; each shows views of the model."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import Screen

from hexacell.screen import widgets
from hexacell.screen.plot_panel import PlotPanel
from hexacell.screen.preferences import WITH_LENGTH
from hexacell.screen.robot_panel import RobotPanel
from hexacell.screen.widgets import titled
from hexacell.text.screens.table_columns import PARAMETER_COLUMNS, RECORD_COLUMNS, RUN_COLUMNS

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel


class TabScreen(Screen[None]):
    """One of the five screens.

    Attributes:
        theme_of_styles: the theme that it was styled for last.
    """

    TAB: ClassVar[str]

    def __init__(self, keys: Mapping[str, str]) -> None:
        super().__init__()
        self._keys = keys
        self.theme_of_styles = self.app.theme

    def compose(self) -> ComposeResult:
        """The first lines, the banner, what is its own, and the keys."""
        yield widgets.TopLine()
        yield widgets.TabLine(self.TAB, self._keys)
        yield widgets.BannerBar()
        yield from self._parts()
        yield widgets.KeyLine()

    @abstractmethod
    def _parts(self) -> ComposeResult: ...

    def draw(self, model: ScreenModel, has_effect: Callable[[str], bool]) -> None:
        """Show what is so now."""
        self.query_one(widgets.TopLine).show(*model.header())
        self.query_one(widgets.BannerBar).show(model.banner(self.TAB))
        widgets.show_parts(self, model, self.TAB)
        self.query_one(widgets.KeyLine).show(has_effect)


class CellScreen(TabScreen):
    """A card for each device, what the cell file states in a few lines, and a drawing of the robot."""

    TAB = "cell"
    BINDINGS: ClassVar[list[BindingType]] = [Binding("f", "app.cell_file", "Cell file")]

    def _parts(self) -> ComposeResult:
        yield widgets.CardGrid(id="cards")
        with Horizontal(id="about"):
            yield titled(widgets.TextList(id="facts"), "Cell")
            yield titled(RobotPanel(id="robot"), "Robot at its first pose")


class PreflightScreen(TabScreen):
    """The checklist beside the plan."""

    TAB = "preflight"
    AUTO_FOCUS = "#checklist"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "app.perform('check')", "Look at all", key_display="Enter"),
        Binding("s", "app.perform('start', 'optimise')", "Calibrate"),
        Binding("k", "app.perform('start', 'check')", "Check"),
        Binding("K", "app.perform('start', 'quick')", "Quick"),
        Binding("r", "app.perform('start', 'resume')", "Resume"),
        Binding("l", "app.perform('start', 'length')", "Length"),
        Binding("L", f"app.perform('start', '{WITH_LENGTH}')", "Calibrate, length"),
        Binding("v", "app.perform('preview')", "Plan"),
        Binding("x", "app.plan", "Poses"),
        Binding("i", "app.perform('unfold')", "Identities"),
    ]

    def _parts(self) -> ComposeResult:
        with Horizontal(id="sides"):
            yield titled(widgets.TextList(id="checklist"), "What must hold before the robot moves")
            yield titled(widgets.TextList(id="plan"), "The plan")


class MeasureScreen(TabScreen):
    """Progress and gauges above, and below the records beside the predicted accuracy."""

    TAB = "measure"
    AUTO_FOCUS = "#records"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "app.perform('play')", "Play or halt", priority=True),
        Binding("right", "app.perform('step', '1')", "On", priority=True),
        Binding("left", "app.perform('step', '-1')", "Back", priority=True),
        Binding("plus", "app.perform('play', '+')", "Faster", show=False),
        Binding("minus", "app.perform('play', '-')", "Slower", show=False),
        Binding("pagedown", "app.perform('step', '100')", "A hundred on", show=False, priority=True),
        Binding("pageup", "app.perform('step', '-100')", "A hundred back", show=False, priority=True),
        Binding("home", "app.perform('step', 'first')", "To the beginning", show=False, priority=True),
        Binding("end", "app.perform('step', 'last')", "To the end", show=False, priority=True),
    ]

    def _parts(self) -> ComposeResult:
        with Vertical(id="upper"):
            yield titled(widgets.ProgressPanel(id="progress"), "Progress")
            yield titled(widgets.LinePanel(id="gauges"), "Gauges, deviation from the reference")
        with Horizontal(id="lower"):
            yield titled(widgets.RecordTable(RECORD_COLUMNS, id="records"), "Records")
            yield PlotPanel(id="accuracy")


class ReviewScreen(TabScreen):
    """Verdict and consequences stay in sight; the rest scrolls below them."""

    TAB = "review"
    AUTO_FOCUS = "#details"

    def _parts(self) -> ComposeResult:
        with Vertical(id="outcome"):
            yield widgets.TextPanel(id="verdict")
            yield widgets.LinePanel(id="consequences")
        with VerticalScroll(id="details"):
            yield titled(widgets.LinePanel(id="scope"), "What it holds for")
            with Horizontal(id="plots"):
                yield PlotPanel(id="plot-deviation")
                yield PlotPanel(id="plot-residual")
                yield PlotPanel(id="plot-accuracy")
            with titled(Vertical(), "Parameters"):
                yield widgets.TextPanel(id="frames")
                yield widgets.Table(PARAMETER_COLUMNS, id="parameters")
            yield titled(widgets.TextPanel(id="change"), "The change of the controller's config")


class HistoryScreen(TabScreen):
    """The runs beside the course of the error, and below what was asked about one of them."""

    TAB = "history"
    AUTO_FOCUS = "#runs"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("v", "about('compare')", "Compare"),
        Binding("b", "about('roll back')", "Go back to it"),
        Binding("w", "write", "Write its proposal"),
        Binding("o", "app.perform('drift')", "Drift"),
    ]

    is_asked = False

    def _parts(self) -> ComposeResult:
        with Horizontal(id="sides"):
            yield titled(widgets.ChoiceTable(RUN_COLUMNS, id="runs"), "Runs, the latest first")
            yield PlotPanel(id="trend")
        yield titled(widgets.TextList(id="comparison"), "Comparison (v), drift (o), changes")

    def draw(self, model: ScreenModel, has_effect: Callable[[str], bool]) -> None:
        """Show what is so now."""
        self.is_asked = model.question() is not None
        runs = {one.name: one.summary for one in model.runs or ()}

        def has_effect_here(action: str) -> bool:
            chosen = runs.get(self.query_one(widgets.ChoiceTable).chosen or "")
            may = {
                "write": self.is_asked or (chosen is not None and chosen.has_proposal),
                "about('roll back')": chosen is not None and chosen.has_written,
            }
            return has_effect(action) and may.get(action, True)

        super().draw(model, has_effect_here)

    async def action_about(self, what: str) -> None:
        """Do something about the run that is chosen."""
        if (run := self.query_one(widgets.ChoiceTable).chosen) is not None:
            await self.run_action(f"app.perform({what!r}, {run!r})")

    async def action_write(self) -> None:
        """Write the proposal of the chosen run; a question that waits comes first, as on every screen."""
        if self.is_asked:
            await self.run_action("app.answer")
        else:
            await self.action_about("apply")

    async def on_data_table_row_selected(self) -> None:
        """Show the run again."""
        await self.action_about("open")
