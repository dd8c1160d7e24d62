"""What the five screens have in common: the first lines, the footer, and that they show a backend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from textual.app import ComposeResult
from textual.screen import Screen

from hexacell.screen.backend import Backend
from hexacell.screen.widgets.key_line import KeyLine
from hexacell.screen.widgets.top_line import TabLine, TopLine


class TabScreen(Screen[None]):
    """One of the five screens; drawn ten times a second while it is in front."""

    TAB: ClassVar[str]

    def __init__(self, keys: Mapping[str, str]) -> None:
        super().__init__()
        self._keys = keys

    def compose(self) -> ComposeResult:
        """The first lines, what is its own, and the footer."""
        yield TopLine()
        yield TabLine(self.TAB, self._keys)
        yield from self.compose_body()
        yield KeyLine(self._keys)

    def compose_body(self) -> ComposeResult:
        """What this screen has of its own."""
        yield from ()

    def draw(self, backend: Backend) -> None:
        """Show what is so now."""
        self.query_one(TopLine).show(backend.header())
        self.draw_body(backend)
        self.query_one(KeyLine).show(backend.allows)

    def draw_body(self, backend: Backend) -> None:
        """The same for what it has of its own."""
