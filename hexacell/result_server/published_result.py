"""Runs that have ended as results for other machines, in the words of OPC 40001-101 (Result Transfer)."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import IntEnum

from hexacell.cell.loader import Cell
from hexacell.errors import FileError
from hexacell.runs.run_folder import folder_stamps, runs_folder
from hexacell.services.history.past_runs import past_runs
from hexacell.services.history.run_index import PastRun
from hexacell.verdict.decision import Verdict


class ResultEvaluation(IntEnum):
    """Whether a result was in tolerance: values of ResultEvaluationEnum."""

    UNDEFINED = 0
    OK = 1
    NOT_OK = 2
    NOT_DECIDABLE = 3


class ResultState(IntEnum):
    """How far the measurement went: values of ResultState."""

    COMPLETED = 1
    ABORTED = 3


EVALUATIONS = {
    None: ResultEvaluation.UNDEFINED,
    Verdict.PASS: ResultEvaluation.OK,
    Verdict.FAIL: ResultEvaluation.NOT_OK,
}
"""By the verdict of a run; for other verdicts it cannot be decided."""

SEVERITIES = {
    ResultEvaluation.OK: 100,
    ResultEvaluation.UNDEFINED: 500,
    ResultEvaluation.NOT_DECIDABLE: 500,
    ResultEvaluation.NOT_OK: 800,
}
"""Severity of the event, 1 to 1000 (OPC 10000-5, 6.4.2)."""


@dataclass(frozen=True, slots=True)
class PublishedResult:
    """A run that has ended, its values in the order of the server's fields. NaN where nothing was found.

    ``details`` is how it ended, in words.
    """

    result_id: str
    is_simulated: bool
    state: ResultState
    created: datetime
    evaluation: ResultEvaluation
    details: str
    mode: str
    verdict: str
    position_mm: float
    expanded_mm: float
    limit_mm: float


def published_result(cell: str, run: PastRun, *, is_simulated: bool) -> PublishedResult | None:
    """The result of a run; None for one that goes on, or that cannot be read."""
    summary = run.summary
    if not summary.is_over or summary.ended is None:
        return None
    verdict, position = summary.verdict, summary.position
    numbers = (None,) * 3 if position is None else (position.value, position.expanded, position.limit)
    return PublishedResult(
        f"{cell}/{run.name}",
        is_simulated,
        ResultState.ABORTED if verdict is None else ResultState.COMPLETED,
        summary.ended,
        EVALUATIONS.get(verdict, ResultEvaluation.NOT_DECIDABLE),
        summary.line,
        summary.mode,
        "" if verdict is None else verdict.value,
        *(math.nan if one is None else one for one in numbers),
    )


class NewResults:
    """Results of a cell, each given once; ``warn`` gets the reason, once, why runs cannot be read."""

    def __init__(self, cell: Cell, warn: Callable[[str], None]) -> None:
        self._cell = cell
        self._warn = warn
        self._stamps: Mapping[str, str] | None = None
        self._known: set[str] = set()
        self._warned: str | None = None

    def fetch(self) -> list[PublishedResult]:
        """New results, the oldest first. Runs are read only if a run folder has changed."""
        try:
            stamps = folder_stamps(runs_folder(self._cell))
            if stamps == self._stamps:
                return []
            name, is_simulated = self._cell.settings.name, self._cell.settings.simulation is not None
            found = [
                published_result(name, run, is_simulated=is_simulated)
                for run in reversed(past_runs(self._cell))
            ]
        except FileError as error:
            if str(error) != self._warned:
                self._warned = str(error)
                self._warn(self._warned)
            return []
        self._stamps, self._warned = stamps, None
        fresh = [one for one in found if one is not None and one.result_id not in self._known]
        self._known.update(one.result_id for one in fresh)
        return fresh
