"""A picture with its title and its legend; or what there is to say while there is nothing to draw."""

from __future__ import annotations

from textual.containers import Vertical

from hexacell.screen.widgets.text_panel import TextPanel
from hexacell.text.screens.plot_lines import plot_lines
from hexacell.text.screens.views import PlotView


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
