"""What the screens are made of. Text is drawn again only where it changed.

Textual's own footer makes a widget of each key, and all of them anew with each change of the screen, which
takes longer than all else on it; so the keys are a line of text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.screen import Screen
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from hexacell.printable import printable
from hexacell.screen.preferences import KEYS, ScreenAction
from hexacell.text.screens.views import Line, PlotView, Urgency, plot_lines

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel


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
            self.set_classes([*(c for c in self.classes if not c.startswith("urgency-"))])
            self.add_class(f"urgency-{urgency}")


class TextList(VerticalScroll):
    """Lines that scroll; may follow the last one."""

    def __init__(self, *, id: str | None = None, classes: str | None = None, follows: bool = False) -> None:  # noqa: A002 - as in every widget
        self._panel, self._follows = TextPanel(), follows
        self._count, self._is_at_end = 0, False
        super().__init__(self._panel, id=id, classes=classes)

    def show(self, lines: Sequence[str]) -> None:
        """Show these lines."""
        self._panel.show("\n".join(lines))
        self._count = len(lines)
        self.on_resize()

    def on_resize(self) -> None:
        """Stay at the end until somebody scrolls; lines that all have room begin at the top."""
        is_long = self._follows and self._count > self.size.height > 0
        if is_long != self._is_at_end:
            self._is_at_end = is_long
            self.anchor(is_long)


MOST_LINES = 6
"""Three gauges, encoders, controller and stop line."""

WORDS = ("Now", "Next", "Time", "Stop")


class DevicePanel(Vertical):
    """A line for each device."""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - as in every widget
        self._lines = [TextPanel() for _ in range(MOST_LINES)]
        super().__init__(*self._lines, id=id)

    def show(self, lines: Sequence[Line]) -> None:
        """Show the devices."""
        for number, panel in enumerate(self._lines):
            panel.display = number < len(lines)
            if panel.display:
                panel.show(*lines[number])


class GuidancePanel(Vertical):
    """Four lines, the first one emphasised."""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - as in every widget
        self._lines = {word: TextPanel(classes=f"guidance-{word.lower()}") for word in WORDS}
        super().__init__(*self._lines.values(), id=id)

    def show(self, guidance: Mapping[str, str]) -> None:
        """Show the guidance."""
        for word, text in guidance.items():
            self._lines[word].show(f"{word:5}{text}")


class PlotPanel(Vertical):
    """Drawn in characters, as large as there is room."""

    def __init__(self, *, id: str | None = None, classes: str | None = None) -> None:  # noqa: A002 - as in every widget
        self._title, self._legend = TextPanel(classes="title"), TextPanel(classes="legend")
        self._drawing = _Drawing(classes="drawing")
        self._view: PlotView | None = None
        super().__init__(self._title, self._drawing, self._legend, id=id, classes=classes)

    def show(self, view: PlotView) -> None:
        """Show a view."""
        if view != self._view:
            self._view = view
            self._title.show(view.title)
            self._legend.show(view.note if view.is_empty else view.legend)
            self._drawing.display = not view.is_empty
            self._drawing.draw(view)


class _Drawing(TextPanel):
    """The picture itself; drawn again when its size changes."""

    _view: PlotView | None = None

    def draw(self, view: PlotView) -> None:
        """Draw a view."""
        self._view = view
        self.on_resize()

    def on_resize(self) -> None:
        """Draw it as large as there is room now."""
        if self._view is not None:
            room = self.content_region.size
            self.show("\n".join(plot_lines(self._view, room.width, room.height)))


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
    """The cell, what is done there, its state, and who is in control."""

    def compose(self) -> ComposeResult:
        """Left what is done, right how it stands."""
        yield TextPanel("hexacell", id="where")
        yield TextPanel("starting", id="state")

    def show(self, where: str, state: str, urgency: Urgency) -> None:
        """Show what is done where, and how it stands."""
        self.query_one("#where", TextPanel).show(where)
        self.query_one("#state", TextPanel).show(state, urgency)


class TabLine(Static):
    """The five screens with their keys; the present one is marked."""

    def __init__(self, present: str, keys: Mapping[str, str]) -> None:
        parts = [
            Content.from_markup(
                f"[@click=app.show('{name}')]{'[reverse b]>' if name == present else ' '}$text "
                f"{'[/]' if name == present else ''}[/]",
                text=f"{keys[name]} {name.capitalize()}",
            )
            for name in TABS
        ]
        super().__init__(Content("  ").join(parts))


_ACTIONS = {
    f"perform('{action}')": action
    for action in ScreenAction
    if any(one.show and one.action == f"perform('{action}')" for one in KEYS)
}
"""The actions that may have no effect, by what a key performs."""


class KeyLine(Static):
    """A key with its word each; a click does the same."""

    def __init__(self, keys: Mapping[str, str]) -> None:
        self._keys = keys
        self._has_effect = dict.fromkeys(_ACTIONS.values(), False)
        super().__init__(self._content())

    def show(self, allows: Callable[[ScreenAction], bool]) -> None:
        """Show which keys have an effect."""
        has_effect = {action: allows(action) for action in self._has_effect}
        if has_effect != self._has_effect:
            self._has_effect = has_effect
            self.update(self._content())

    def _content(self) -> Content:
        parts = []
        for one in KEYS:
            if one.show:
                call = one.action if one.action.endswith(")") else f"{one.action}()"
                has_effect = one.action not in _ACTIONS or self._has_effect[_ACTIONS[one.action]]
                text = "[b]$key[/b] $word" if has_effect else "[dim][b]$key[/b] $word[/dim]"
                key, word = self._keys[str(one.id)], one.description
                parts.append(Content.from_markup(f"[@click=app.{call}]{text}[/]", key=key, word=word))
        palette = Content.from_markup("[@click=app.command_palette()]^p palette[/]")
        return Content("  ").join([*parts, palette])


def show_parts(screen: Screen[Any], model: ScreenModel, name: str) -> None:
    """Show in each part of a screen what the model has for it."""
    for part, shown in model.shown(name).items():
        widget: Any = screen.query_one(f"#{part}")
        widget.show(*shown)
