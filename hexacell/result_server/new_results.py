"""The runs of a cell that have ended since somebody looked last."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from hexacell.cell.loader import Cell
from hexacell.errors import FileError
from hexacell.result_server.published_result import PublishedResult, published_result
from hexacell.runs.folder_stamps import folder_stamps
from hexacell.runs.run_folder import runs_folder
from hexacell.services.history.history import past_runs


class NewResults:
    """Results of a cell, each given once; ``warn`` is told, once each, why runs cannot be read."""

    def __init__(self, cell: Cell, warn: Callable[[str], None]) -> None:
        self._cell = cell
        self._warn = warn
        self._stamps: Mapping[str, str] | None = None
        self._known: set[str] = set()
        self._warned: str | None = None

    def fetch(self) -> list[PublishedResult]:
        """Those that are new, the oldest first. Runs are read only if a run folder has changed."""
        try:
            stamps = folder_stamps(runs_folder(self._cell))
            if stamps == self._stamps:
                return []
            found = self._ended()
        except FileError as error:
            self._warn_once(str(error))
            return []
        self._stamps, self._warned = stamps, None
        fresh = [one for one in found if one.result_id not in self._known]
        self._known.update(one.result_id for one in fresh)
        return fresh

    def _ended(self) -> list[PublishedResult]:
        name, is_simulated = self._cell.settings.name, self._cell.settings.simulation is not None
        found = (
            published_result(name, run, is_simulated=is_simulated)
            for run in reversed(past_runs(self._cell))
        )
        return [one for one in found if one is not None]

    def _warn_once(self, text: str) -> None:
        if text != self._warned:
            self._warned = text
            self._warn(text)
