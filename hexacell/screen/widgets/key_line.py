"""The last line of every screen: the keys, dim where they have no effect now.

Textual's own footer makes a widget of each key, and all of them anew with each change of the screen, which
takes longer than all else on it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from textual.content import Content
from textual.widgets import Static

from hexacell.screen.backend import ScreenAction
from hexacell.screen.key_map import KEYS

PALETTE = "^p palette"


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
        parts = [self._part(str(one.id), one.action, one.description) for one in KEYS if one.show]
        palette = Content.from_markup(f"[@click=app.command_palette()]{PALETTE}[/]")
        return Content("  ").join([*parts, palette])

    def _part(self, name: str, action: str, word: str) -> Content:
        call = action if action.endswith(")") else f"{action}()"
        has_effect = action not in _ACTIONS or self._has_effect[_ACTIONS[action]]
        text = "[b]$key[/b] $word" if has_effect else "[dim][b]$key[/b] $word[/dim]"
        return Content.from_markup(f"[@click=app.{call}]{text}[/]", key=self._keys[name], word=word)


_ACTIONS = {
    f"perform('{action}')": action
    for action in ScreenAction
    if any(one.show and one.action == f"perform('{action}')" for one in KEYS)
}
"""Those that may have no effect, by how a key names them."""
