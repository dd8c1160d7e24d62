"""Help for the screen that is in front, and all keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical
from textual.screen import ModalScreen

from hexacell.screen.key_map import KEYS, preferences_path, shown_path
from hexacell.screen.widgets.text_panel import TextList, TextPanel
from hexacell.text.screens.help_texts import (
    KEYS_NOTE,
    KEYS_TITLE,
    REPLAY_HELP,
    SCREEN_HELP,
    reflowed,
)


class HelpOverlay(ModalScreen[None]):
    """What the screen is for, and the keys."""

    BINDINGS: ClassVar[list[BindingType]] = [("enter,escape,question_mark,q", "dismiss", "Close")]
    AUTO_FOCUS = "#help-text"

    def __init__(self, tab: str, keys: Mapping[str, str]) -> None:
        super().__init__()
        self._tab, self._keys = tab, keys

    def compose(self) -> ComposeResult:
        """The texts."""
        with Vertical(id="help", classes="overlay"):
            yield TextPanel(f"Help: {self._tab}", classes="overlay-title")
            yield TextList(id="help-text")
            yield TextPanel("Escape closes this, the arrows scroll.", classes="hint")

    def on_mount(self) -> None:
        """Show the texts."""
        keys = [f"  {self._keys[str(one.id)]:8} {one.description}" for one in KEYS]
        note = KEYS_NOTE.format(path=shown_path(preferences_path()))
        about = [*reflowed(SCREEN_HELP[self._tab]), ""]
        replay = ["", *reflowed(REPLAY_HELP)]
        self.query_one(TextList).show([*about, f"{KEYS_TITLE}:", *keys, "", note, *replay])
