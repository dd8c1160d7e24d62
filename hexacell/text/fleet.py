"""Text and documents for all cells that share an archive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

from hexacell.services.history.fleet import FleetCell, FleetRun, is_overdue_now

NO_CELLS = "No cell has put anything into this archive: hexacell status CELL does, and each run."
NO_FLEET_RUNS = "There are no runs in this archive."


def fleet_text(cells: Sequence[FleetCell]) -> str:
    """A line a cell of at most 80 columns, and below it what needs somebody."""
    if not cells:
        return NO_CELLS
    head = _fleet_columns("cell", "host", "latest verdict", "error, mm", "last run")
    return "\n".join([head, *(line for one in cells for line in _cell_lines(one))])


def fleet_document(cells: Sequence[FleetCell]) -> dict[str, Any]:
    """What ``status --archive URL --json`` prints."""
    return {"cells": [one.model_dump(mode="json") | {"overdue": is_overdue_now(one)} for one in cells]}


def fleet_history_text(runs: Sequence[FleetRun]) -> str:
    """A line a run."""
    if not runs:
        return NO_FLEET_RUNS
    head = _fleet_columns("cell", "host", "verdict", "error, mm", "ended")
    return "\n".join([head, *map(_run_line, runs)])


def fleet_history_document(runs: Sequence[FleetRun]) -> dict[str, Any]:
    """What ``history --archive URL --json`` prints without a cell."""
    return {"runs": [_run_document(one) for one in runs]}


def _cell_lines(one: FleetCell) -> Iterator[str]:
    verdict = "-" if one.verdict is None else one.verdict.value
    yield _fleet_columns(
        one.name, one.host, verdict, _error(one.position_mm, one.expanded_mm), _moment(one.latest_at)
    )
    if one.due_at is not None:
        yield f"  calibration {'OVERDUE since' if is_overdue_now(one) else 'due on'} {one.due_at:%Y-%m-%d}"
    if one.proposal is not None:
        yield f"  a proposal waits for a person: {one.proposal}, on {one.host}"
    if one.changes:
        yield "  the robot has changed; hexacell history --drift on its computer tells more"


def _run_line(one: FleetRun) -> str:
    summary = one.summary
    verdict = "-" if summary.verdict is None else summary.verdict.value
    position = None if summary.accuracy is None else summary.accuracy.position
    error = "-" if position is None else _error(position.value, position.expanded)
    return _fleet_columns(one.cell, _host(one), verdict, error, _moment(summary.ended))


def _run_document(one: FleetRun) -> dict[str, Any]:
    summary = one.summary
    position = None if summary.accuracy is None else summary.accuracy.position
    return {
        "cell": one.cell,
        "host": _host(one),
        "run": one.name,
        "mode": summary.mode,
        "began": None if summary.began is None else summary.began.isoformat(),
        "ended": None if summary.ended is None else summary.ended.isoformat(),
        "verdict": None if summary.verdict is None else summary.verdict.value,
        "position_mm": None if position is None else position.value,
        "expanded_mm": None if position is None else position.expanded,
    }


def _host(one: FleetRun) -> str:
    return one.place.partition(":")[0]


def _error(value: float | None, expanded: float | None) -> str:
    return "-" if value is None or expanded is None else f"{value:.3f} +- {expanded:.3f}"


def _moment(at: datetime | None) -> str:
    return "-" if at is None else f"{at:%Y-%m-%d %H:%M}"


def _fleet_columns(cell: str, host: str, verdict: str, error: str, when: str) -> str:
    return f"{cell[:18]:18} {host[:11]:11} {verdict:16} {error:15} {when}".rstrip()
