"""The cells at a glance: for people, as a document, and as metrics that a monitoring system collects.

The metrics are in the text format of Prometheus, for the textfile collector of its node exporter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from textwrap import indent
from typing import Any

from hexacell.services.history.cell_status import (
    CellStatus,
    FleetCell,
    FleetRun,
    UnreadableCell,
    is_overdue_now,
)
from hexacell.services.history.run_index import PastRun
from hexacell.text.changes import legs_text
from hexacell.text.history import error_text
from hexacell.verdict.decision import Verdict

LONGEST_NAME = 22

HELP = {
    "hexacell_in_use": "Whether a process holds the cell.",
    "hexacell_last_run_timestamp_seconds": "When the latest run ended.",
    "hexacell_last_run_begun": "Whether the latest run began; one that was refused each time did not.",
    "hexacell_last_run_passed": "Whether the latest run with a verdict passed.",
    "hexacell_last_verdict": "1 for the verdict of the latest run that has one.",
    "hexacell_last_pass_timestamp_seconds": "When a run passed last.",
    "hexacell_calibration_timestamp_seconds": "When the run ended whose config the controller has.",
    "hexacell_calibration_due_timestamp_seconds": "When the next calibration is due.",
    "hexacell_position_error_mm": "Largest position error at the task poses, by the latest verdict.",
    "hexacell_position_expanded_mm": "Its expanded uncertainty (k = 2).",
    "hexacell_position_limit_mm": "Its limit.",
    "hexacell_open_proposal": "Whether a proposal waits for a person.",
    "hexacell_changes_found": "Changes of the robot that the watch over all runs found.",
    "hexacell_largest_drift_sigmas": "Largest rate of a parameter since the last change, over its sigma.",
    "hexacell_largest_sum_ratio": "Largest cumulative sum of a parameter, over the limit of an alarm.",
}


def status_text(found: Sequence[CellStatus], unreadable: Sequence[UnreadableCell] = ()) -> str:
    """A line a cell, and below it what needs somebody; the broken ones at the end."""
    head = f"{'cell':{LONGEST_NAME}} {'latest verdict':17} {'error, mm':16} {'when':17} in use"
    lines = [head, *(line for one in found for line in _lines(one))]
    for one in unreadable:
        lines += [
            f"{one.path.name[:LONGEST_NAME]:{LONGEST_NAME}} cannot be read",
            indent(str(one.error), "  "),
        ]
    return "\n".join(lines)


def status_document(
    found: Sequence[CellStatus], unreadable: Sequence[UnreadableCell] = ()
) -> dict[str, Any]:
    """What ``status --json`` prints."""
    broken = [{"cell": str(one.path), "error": str(one.error)} for one in unreadable]
    return {"cells": [_document(one) for one in found], "unreadable": broken}


def metrics_text(found: Sequence[CellStatus]) -> str:
    """All samples, those of one metric together, each with its help."""
    samples: dict[str, list[str]] = {name: [] for name in HELP}
    for one in found:
        for name, labels, value in _samples(one):
            samples[name].append(f"{name}{{{_labels(one, labels)}}} {value}")
    return "".join(
        f"# HELP {name} {HELP[name]}\n# TYPE {name} gauge\n" + "".join(f"{line}\n" for line in lines)
        for name, lines in samples.items()
        if lines
    )


def _lines(one: CellStatus) -> Iterator[str]:
    judged = one.judged
    verdict = "-" if judged is None or judged.summary.verdict is None else judged.summary.verdict.value
    error = "-" if judged is None else error_text(judged)
    when = (
        "-" if judged is None or judged.summary.ended is None else f"{judged.summary.ended:%Y-%m-%d %H:%M}"
    )
    used = "no" if one.in_use_by is None else f"by {one.in_use_by}"
    yield f"{one.cell.settings.name[:LONGEST_NAME]:{LONGEST_NAME}} {verdict:17} {error:16} {when:17} {used}"
    if one.proposal is not None:
        yield f"  a proposal waits for a person: hexacell apply {one.proposal.folder.path}"
    if one.latest is not None and not one.latest.summary.has_begun:
        yield f"  {one.latest.name}: {one.latest.summary.line}"
    if one.latest is not None and not one.latest.summary.is_over:
        yield f"  {one.latest.name}: {one.latest.summary.line}"
    if one.ends_in_future is not None:
        yield f"  {one.ends_in_future.name} ended in the future: this computer's clock is wrong, or was"
    if one.due_at is not None:
        yield f"  calibration due on {one.due_at:%Y-%m-%d}"
    if one.drift.changes:
        last = one.drift.changes[-1]
        noticed = f"noticed on {last.noticed:%Y-%m-%d}"
        yield f"  leg {legs_text(last)} changed, {noticed}; hexacell history --drift tells more"


def _document(one: CellStatus) -> dict[str, Any]:
    judged = one.judged
    verdict = None if judged is None else judged.summary.verdict
    accuracy = None if judged is None else judged.summary.accuracy
    worst = one.worst_share
    return {
        "cell": str(one.cell.path),
        "name": one.cell.settings.name,
        "in_use_by": one.in_use_by,
        "verdict": None if verdict is None else verdict.value,
        "position_mm": None if accuracy is None else accuracy.position.value,
        "expanded_mm": None if accuracy is None else accuracy.position.expanded,
        "judged_at": None if judged is None else _iso(judged.summary.ended),
        "passed_at": _iso(one.passed_at),
        "in_force": None if one.in_force is None else str(one.in_force.folder.path),
        "due_at": _iso(one.due_at),
        "proposal": None if one.proposal is None else str(one.proposal.folder.path),
        "not_begun": None if not _is_refused(one) or one.latest is None else one.latest.summary.line,
        "changes": len(one.drift.changes),
        "largest_sum": None if worst is None else {"parameter": worst[0], "ratio": worst[1]},
    }


def _samples(one: CellStatus) -> Iterator[tuple[str, dict[str, str], str]]:
    yield "hexacell_in_use", {}, _flag(one.in_use_by is not None)
    yield "hexacell_open_proposal", {}, _flag(one.proposal is not None)
    yield "hexacell_changes_found", {}, str(len(one.drift.changes))
    if one.latest is not None:
        yield "hexacell_last_run_begun", {}, _flag(not _is_refused(one))
    times = {
        "hexacell_last_run_timestamp_seconds": _ended(one.latest),
        "hexacell_last_pass_timestamp_seconds": one.passed_at,
        "hexacell_calibration_timestamp_seconds": _ended(one.in_force),
        "hexacell_calibration_due_timestamp_seconds": one.due_at,
    }
    yield from ((name, {}, repr(at.timestamp())) for name, at in times.items() if at is not None)
    worst = {
        "hexacell_largest_drift_sigmas": one.surest_drift,
        "hexacell_largest_sum_ratio": one.worst_share,
    }
    for name, found in worst.items():
        if found is not None:
            yield name, {"parameter": found[0]}, repr(found[1])
    if one.judged is None:
        return
    verdict, accuracy = one.judged.summary.verdict, one.judged.summary.accuracy
    yield "hexacell_last_run_passed", {}, _flag(verdict is Verdict.PASS)
    yield from (
        ("hexacell_last_verdict", {"verdict": each.value}, _flag(each is verdict)) for each in Verdict
    )
    if accuracy is not None:
        yield "hexacell_position_error_mm", {}, repr(accuracy.position.value)
        yield "hexacell_position_expanded_mm", {}, repr(accuracy.position.expanded)
        yield "hexacell_position_limit_mm", {}, repr(accuracy.position.limit)


def _is_refused(one: CellStatus) -> bool:
    """Whether the latest run never began."""
    return one.latest is not None and not one.latest.summary.has_begun


def _ended(run: PastRun | None) -> datetime | None:
    return None if run is None else run.summary.ended


def _labels(one: CellStatus, further: dict[str, str]) -> str:
    labels = {"cell": one.cell.settings.name, **further}
    return ",".join(f'{name}="{_escaped(text)}"' for name, text in labels.items())


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _flag(value: bool) -> str:
    return "1" if value else "0"


def _iso(at: datetime | None) -> str | None:
    return None if at is None else at.isoformat()


# JOINED Text and documents for all cells that share an archive.

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
