"""Text that is drawn again only where it changed, plain or in a list that scrolls."""

from __future__ import annotations

from collections.abc import Sequence

from textual.containers import VerticalScroll
from textual.widgets import Static

from hexacell.presentation.screens.views import Urgency


class TextPanel(Static):
    """Text without markup; its class tells how urgent it is."""

    def __init__(self, text: str = "", *, id: str | None = None, classes: str | None = None) -> None:  # noqa: A002 - as in every widget
        super().__init__(text, id=id, classes=classes, markup=False)
        self._text, self._urgency = text, Urgency.CALM

    @property
    def text(self) -> str:
        """What it shows."""
        return self._text

    def show(self, text: str, urgency: Urgency = Urgency.CALM) -> None:
        """Show a text."""
        if text != self._text:
            self._text = text
            self.update(text)
        if urgency is not self._urgency:
            self._urgency = urgency
            self.set_classes([*(c for c in self.classes if not c.startswith("urgency-"))])
            self.add_class(f"urgency-{urgency}")


class TextList(VerticalScroll):
    """Lines that scroll; may follow the last one."""

    def __init__(self, *, id: str | None = None, classes: str | None = None, follows: bool = False) -> None:  # noqa: A002 - as in every widget
        self._panel, self._follows = TextPanel(), follows
        super().__init__(self._panel, id=id, classes=classes)

    @property
    def text(self) -> str:
        """What it shows, scrolled out of sight or not."""
        return self._panel.text

    def show(self, lines: Sequence[str]) -> None:
        """Show these lines; one that follows stays at the end until somebody scrolls."""
        text = "\n".join(lines)
        if text != self._panel.text:
            is_at_end = self.scroll_offset.y >= self.max_scroll_y
            self._panel.show(text)
            if self._follows and is_at_end:
                self.scroll_end(animate=False)

    def on_resize(self) -> None:
        """What was the end is shown again where there is less room now."""
        if self._follows:
            self.scroll_end(animate=False)
