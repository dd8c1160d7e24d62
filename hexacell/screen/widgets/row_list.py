"""Rows of which one is chosen."""

from __future__ import annotations

from collections.abc import Sequence

from textual.content import Content
from textual.widgets import OptionList
from textual.widgets.option_list import Option


class RowList(OptionList):
    """Rows with a name each; what is chosen stays chosen where its name is still there."""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - as in every widget
        super().__init__(id=id, markup=False)
        self._rows: list[tuple[str, str]] = []

    @property
    def chosen(self) -> str | None:
        """The name of the chosen row; none without rows."""
        row = self.highlighted
        return None if row is None or row >= len(self._rows) else self._rows[row][0]

    def show(self, rows: Sequence[tuple[str, str]]) -> None:
        """Show these rows: name and line of each."""
        if list(rows) == self._rows:
            return
        name, row = self.chosen, self.highlighted or 0
        self._rows = list(rows)
        self.clear_options()
        self.add_options(Option(Content(line)) for _, line in rows)
        names = [one for one, _ in rows]
        last = len(names) - 1
        self.highlighted = None if not names else names.index(name) if name in names else min(row, last)
