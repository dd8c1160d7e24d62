"""The robot in characters, as large as there is room."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content
from textual.widgets import Static

if TYPE_CHECKING:
    from hexacell.drawing.shapes import Scene

FEWEST_COLUMNS, FEWEST_ROWS = 24, 8
"""In less room a drawing says nothing."""


class RobotPanel(Static):
    """A scene, drawn again when its size changes."""

    _scene: Scene | None = None
    _theme = ""

    def show(self, scene: Scene | None) -> None:
        """Show a scene; nothing for None."""
        if scene is not self._scene or self._theme != self.app.theme:
            self._scene, self._theme = scene, self.app.theme
            self.on_resize()

    def on_resize(self) -> None:
        """Draw it as large as there is room now."""
        if self._scene is None:
            self.update("")
            return
        from hexacell.drawing.braille import braille_lines  # noqa: PLC0415 - after the first screen
        from hexacell.drawing.shapes import COLOURS  # noqa: PLC0415 - see above

        room = self.content_region.size
        if room.width < FEWEST_COLUMNS or room.height < FEWEST_ROWS:
            self.update("A larger window shows it.")
            return
        lines = braille_lines(self._scene, room.width, room.height)
        is_grey = self._theme == "monochrome"
        self.update(
            Content("\n").join(
                Content("").join(
                    Content.styled(run.text, "" if is_grey or run.role is None else COLOURS[run.role])
                    for run in line
                )
                for line in lines
            )
        )
