"""Figures large enough to be read across a room, drawn with blocks."""

from __future__ import annotations

ROWS = 5
"""Of a figure at scale 1."""

_SHAPES = {
    "0": ("###", "# #", "# #", "# #", "###"),
    "1": (" # ", "## ", " # ", " # ", "###"),
    "2": ("###", "  #", "###", "#  ", "###"),
    "3": ("###", "  #", "###", "  #", "###"),
    "4": ("# #", "# #", "###", "  #", "  #"),
    "5": ("###", "#  ", "###", "  #", "###"),
    "6": ("###", "#  ", "###", "# #", "###"),
    "7": ("###", "  #", "  #", "  #", "  #"),
    "8": ("###", "# #", "###", "# #", "###"),
    "9": ("###", "# #", "###", "  #", "###"),
    "+": ("   ", " # ", "###", " # ", "   "),
    "-": ("   ", "   ", "###", "   ", "   "),
    ".": (" ", " ", " ", " ", "#"),
    "x": ("   ", "# #", " # ", "# #", "   "),
    "y": ("   ", "# #", "###", "  #", "## "),
    "z": ("   ", "###", " # ", "#  ", "###"),
    " ": (" ", " ", " ", " ", " "),
}


def block_text(text: str, scale: int = 1) -> list[str]:
    """A short text of figures, signs and axes in lines of blocks; anything else is left blank.

    A point of a figure is ``2 * scale`` columns wide and ``scale`` rows high.
    """
    shapes = [_SHAPES.get(letter, _SHAPES[" "]) for letter in text]
    rows = [" ".join(shape[row] for shape in shapes) for row in range(ROWS)]
    wide = ["".join(("█" if cell == "#" else " ") * 2 * scale for cell in row).rstrip() for row in rows]
    return [row for row in wide for _ in range(scale)]
