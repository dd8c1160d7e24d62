"""What the screens are made of: text, banner, cards, tables, and the lines of tabs and keys.

Text is drawn again only where it changed. Textual's own footer makes a widget of each key and does not
wrap at 80 columns, so the keys are a line of text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import DataTable, Digits, OptionList, ProgressBar, Static
from textual.widgets.option_list import Option

from hexacell.printable import printable
from hexacell.text.screens.views import Banner, Card, Column, Line, Row, Urgency

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel
    from hexacell.text.screens.measuring import Progress


def set_urgency(widget: Widget, urgency: Urgency) -> None:
    """Give a widget the class of an urgency, and take those of the others."""
    for one in Urgency:
        widget.set_class(one is urgency, f"urgency-{one}")


class TextPanel(Static):
    """Text without markup; its class says how urgent it is."""

    def __init__(self, text: str = "", *, id: str | None = None, classes: str | None = None) -> None:  # noqa: A002 - as in every widget
        super().__init__(printable(text), id=id, classes=classes, markup=False)
        self._urgency = Urgency.CALM

    def show(self, text: str, urgency: Urgency = Urgency.CALM) -> None:
        """Show a text."""
        if (text := printable(text)) != self.content:
            self.update(text)
        if urgency is not self._urgency:
            self._urgency = urgency
            set_urgency(self, urgency)


class LinePanel(Static):
    """Lines of different urgency, which are coloured by it."""

    _lines: Sequence[Line] | None = None

    def show(self, lines: Sequence[Line]) -> None:
        """Show these lines."""
        if lines != self._lines:
            self._lines = lines
            self.update(Content("\n").join(coloured(*line) for line in lines))


COLOURS = {
    Urgency.CALM: "",
    Urgency.GOOD: "$success",
    Urgency.ATTENTION: "bold $warning",
    Urgency.ALARM: "bold $error",
}


def coloured(text: str, urgency: Urgency) -> Content:
    """A text in the colour of an urgency."""
    return Content.styled(printable(text), COLOURS[urgency])


class TextList(VerticalScroll):
    """Lines that scroll."""

    def __init__(self, *, id: str | None = None, classes: str | None = None) -> None:  # noqa: A002 - as in every widget
        self._panel = LinePanel()
        super().__init__(self._panel, id=id, classes=classes)

    def show(self, lines: Sequence[str | Line]) -> None:
        """Show these lines."""
        self._panel.show([(one, Urgency.CALM) if isinstance(one, str) else one for one in lines])


SIGNS = {Urgency.CALM: "", Urgency.GOOD: "✓ ", Urgency.ATTENTION: "▸ ", Urgency.ALARM: "✗ "}
"""Before the word of a banner: its colour is not all that tells how urgent it is."""


class BannerBar(Horizontal):
    """The state in a word, and beside it what to do, what comes next, and how long it takes."""

    def __init__(self) -> None:
        self._word, self._action = TextPanel(classes="banner-word"), TextPanel(classes="banner-action")
        self._following, self._rest = TextPanel(classes="banner-rest"), TextPanel(classes="banner-rest")
        super().__init__(self._word, Vertical(self._action, self._following, self._rest))

    def show(self, banner: Banner) -> None:
        """Show a banner."""
        self._word.show(f"{SIGNS[banner.urgency]}{banner.word}", banner.urgency)
        self._action.show(banner.action)
        self._following.show(banner.following)
        self._rest.show(banner.rest)


class CardPanel(Vertical):
    """One device in a frame: its figure large where there is room, its lines below."""

    def __init__(self) -> None:
        self._digits, self._figure = Digits(classes="card-digits"), TextPanel(classes="card-figure")
        self._lines = TextPanel(classes="card-lines")
        super().__init__(self._digits, self._figure, self._lines, classes="panel card")

    def show(self, card: Card) -> None:
        """Show a device."""
        self.border_title, self.border_subtitle = printable(card.title), printable(card.state)
        figure = printable(card.figure)
        is_number = any(map(str.isdigit, figure))
        self.set_class(is_number, "-number")
        if is_number and self._digits.value != figure:
            self._digits.update(figure)
        self._figure.show(figure, card.urgency)
        self._lines.show("\n".join(card.lines))
        set_urgency(self, card.urgency)


class CardGrid(Widget):
    """A card for each device."""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - as in every widget
        self._cards: list[CardPanel] = []
        super().__init__(id=id)

    def show(self, cards: Sequence[Card]) -> None:
        """Show the devices."""
        if more := [CardPanel() for _ in cards[len(self._cards) :]]:
            self._cards += more
            self.mount(*more)
        for number, panel in enumerate(self._cards):
            panel.display = number < len(cards)
            if panel.display:
                panel.show(cards[number])


class ProgressPanel(Vertical):
    """How far a run is: in words, and as a bar."""

    def __init__(self, *, id: str | None = None, classes: str | None = None) -> None:  # noqa: A002 - as in every widget
        self._place, self._bar = TextPanel(), ProgressBar(show_eta=False)
        super().__init__(self._place, self._bar, id=id, classes=classes)

    def show(self, progress: Progress) -> None:
        """Show how far it is."""
        self._place.show(progress.place)
        self._bar.display = progress.planned > 0
        if (self._bar.total, self._bar.progress) != (progress.planned, progress.done):
            self._bar.update(total=progress.planned or None, progress=min(progress.done, progress.planned))
            self.call_after_refresh(self.on_resize)

    def on_resize(self) -> None:
        """Fill the bar by its width now: it rounds by the width that it has when it is set."""
        bar: Any = self._bar.query_one("#bar")
        bar.percentage = self._bar.percentage


class Table(DataTable[Text]):
    """Rows with a name each, to be read: new rows at the end come into view."""

    CURSOR: ClassVar[Literal["none", "row"]] = "none"

    def __init__(self, columns: Iterable[Column], *, id: str) -> None:  # noqa: A002 - as in every widget
        super().__init__(id=id, cursor_type=self.CURSOR, zebra_stripes=True, cell_padding=0)
        self._rows: list[Row] = []
        self._theme = ""
        self._columns = tuple(columns)

    def on_mount(self) -> None:
        """Make the columns, whose width is fixed: figures are not cut unseen."""
        for one in self._columns:
            self.add_column(_cell(one, one.name, "bold"), width=one.width, key=one.name)

    def show(self, rows: Sequence[Row]) -> None:
        """Show these rows; those that are there already stay as they are."""
        rows = list(rows)
        if (rows == self._rows and self._theme == self.app.theme) or not self.columns:
            return
        is_at_end, known = self.scroll_y >= self.max_scroll_y - 1, len(self._rows)
        if rows[:known] != self._rows or self._theme != self.app.theme:
            self.clear()
            known = 0
        for row in rows[known:]:
            style = _rich_style(self.app.theme_variables, row.urgency)
            cells = zip(self._columns, row.cells, strict=True)
            self.add_row(*(_cell(column, text, style) for column, text in cells), key=row.name)
        self._rows, self._theme = rows, self.app.theme
        if is_at_end:
            self.call_after_refresh(self.scroll_end, animate=False)


class ChoiceTable(Table):
    """A table of which a row is chosen, which stays chosen, and something is done with it by Enter."""

    CURSOR = "row"
    BINDINGS: ClassVar[list[BindingType]] = [Binding("enter", "select_cursor", "Show", key_display="Enter")]

    @property
    def chosen(self) -> str | None:
        """The name of the chosen row; None without rows."""
        return self._rows[self.cursor_row].name if 0 <= self.cursor_row < len(self._rows) else None

    def show(self, rows: Sequence[Row]) -> None:
        """Show these rows."""
        name, names = self.chosen, [one.name for one in rows]
        super().show(rows)
        if name in names:
            self.move_cursor(row=names.index(name))


class RecordTable(ChoiceTable):
    """A table of records: the last one is chosen unless another is."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "record_again", "Record again", key_display="Enter")
    ]

    def show(self, rows: Sequence[Row]) -> None:
        """Show these rows."""
        is_last = self.cursor_row >= len(self._rows) - 1
        super().show(rows)
        if is_last:
            self.move_cursor(row=len(rows) - 1)

    async def action_record_again(self) -> None:
        """Ask for the chosen record once more."""
        if (record := self.chosen) is not None:
            await self.run_action(f"app.perform('measure again', {record!r})")


def _cell(column: Column, text: str, style: str) -> Text:
    return Text(printable(text), style, justify="right" if column.is_figure else "left")


def _rich_style(variables: Mapping[str, str], urgency: Urgency) -> str:
    """The colour of an urgency as Rich, which draws the cells of tables, names it."""
    words = COLOURS[urgency].split()
    return " ".join(variables[word.removeprefix("$")] if word.startswith("$") else word for word in words)


class RowList(OptionList):
    """Rows with a name each; what is chosen stays chosen where its name is still there."""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - as in every widget
        super().__init__(id=id, markup=False)
        self._rows: list[tuple[str, str]] = []

    @property
    def chosen(self) -> str | None:
        """The name of the chosen row; None without rows."""
        return None if self.highlighted_option is None else self.highlighted_option.id

    def show(self, rows: Sequence[tuple[str, str]]) -> None:
        """Show these rows: name and line of each."""
        if list(rows) == self._rows:
            return
        name, row = self.chosen, self.highlighted or 0
        self._rows = list(rows)
        self.clear_options()
        self.add_options(Option(Content(printable(line)), id=name) for name, line in rows)
        names = [one for one, _ in rows]
        self.highlighted = (
            names.index(name) if name in names else min(row, len(names) - 1) if names else None
        )


TABS = ("cell", "preflight", "measure", "review", "history")


class TopLine(Horizontal):
    """The cell and what is done there, and who is in control."""

    def compose(self) -> ComposeResult:
        """Left what is done, right who does it."""
        yield TextPanel("hexacell", id="where")
        yield TextPanel("starting", id="who")

    def show(self, where: str, who: str) -> None:
        """Show what is done where, and by whom."""
        self.query_one("#where", TextPanel).show(where)
        self.query_one("#who", TextPanel).show(who)


class TabLine(Static):
    """The five screens with their keys; the present one is marked."""

    def __init__(self, present: str, keys: Mapping[str, str]) -> None:
        parts = [
            Content.from_markup(
                f"[@click=app.show('{name}')]{'[reverse b]▸' if name == present else ' '}$text "
                f"{'[/]' if name == present else ''}[/]",
                text=f"{keys[name]} {name.capitalize()}",
            )
            for name in TABS
        ]
        super().__init__(Content("  ").join(parts))


BETWEEN_KEYS = "  "


class KeyLine(Static):
    """The keys that act here and now, a word each; a click does the same."""

    _shown: tuple[tuple[str, str, str], ...] = ()

    def show(self, has_effect: Callable[[str], bool]) -> None:
        """Show the keys of the screen and those of every screen, without those that have no effect now."""
        # Those of the screen come first.
        every = sorted(self.screen.active_bindings.items(), key=lambda one: one[1].node is self.app)
        shown = {
            one.binding.action: (key, self.app.get_key_display(one.binding), one.binding.description)
            for key, one in reversed(every)
            if one.binding.show and has_effect(one.binding.action)
        }
        parts = tuple(reversed(shown.values()))
        if parts != self._shown:
            self._shown = parts
            self.on_resize()

    def on_resize(self) -> None:
        """Fill lines: a key and its word are not parted, as Textual does even at spaces that forbid it."""
        lines: list[list[Content]] = [[]]
        for key in (_key(*part) for part in self._shown):
            taken = sum(one.cell_length + len(BETWEEN_KEYS) for one in lines[-1])
            if lines[-1] and taken + key.cell_length > self.content_size.width:
                lines.append([])
            lines[-1].append(key)
        self.update(Content("\n").join(Content(BETWEEN_KEYS).join(line) for line in lines))


def _key(key: str, display: str, word: str) -> Content:
    """A key with its word."""
    markup = f"[@click=app.simulate_key('{key}')][b]$display[/b] $word[/]"
    return Content.from_markup(markup, display=display, word=word)


def show_parts(screen: Screen[Any], model: ScreenModel, name: str) -> None:
    """Show in each part of a screen what the model has for it."""
    for part, shown in model.shown(name).items():
        widget: Any = screen.query_one(f"#{part}")
        widget.show(*shown)


def titled(widget: Widget, title: str) -> Widget:
    """A widget in a frame with a title."""
    widget.border_title = title
    widget.add_class("panel")
    return widget
