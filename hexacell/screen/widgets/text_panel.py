"""Text that is drawn again only where it changed, plain or in a list that scrolls."""

from __future__ import annotations

from collections.abc import Sequence

from textual.containers import VerticalScroll
from textual.widgets import Static

from hexacell.text.screens.views import Urgency


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
        self._count, self._is_at_end = 0, False
        super().__init__(self._panel, id=id, classes=classes)

    @property
    def text(self) -> str:
        """What it shows, scrolled out of sight or not."""
        return self._panel.text

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
