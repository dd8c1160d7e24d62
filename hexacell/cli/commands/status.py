"""``hexacell status``: cells at a glance, of this computer or of all that share an archive, and metrics.

The metrics are in the text format of Prometheus, for the textfile collector of its node exporter.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import indent
from typing import Any

from hexacell.cell.loader import is_cell_file
from hexacell.cli.commands.cell import archive_url, cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, FileError, HexacellError, UsageError
from hexacell.plugins import plugin_failures_named
from hexacell.printable import printable
from hexacell.services.history import cell_status
from hexacell.text.history import legs_text
from hexacell.text.layout import error_with_u, figure_with_u, minute, verdict_word
from hexacell.verdict.decision import Verdict

LONGEST_NAME = 22
NO_CELLS = "No cell has put anything into this archive: hexacell status CELL does, and each run."
NO_FLEET_RUNS = "There are no runs in this archive."

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
    "hexacell_largest_sum_ratio": "Largest cumulative sum of a parameter, over the limit of an alarm.",
}
ESCAPES = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n"})


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Show the cells; nothing is changed but the file of metrics, which is replaced whole."""
    if not options.cells:
        return _fleet(options, console)
    if options.archive is not None:
        raise UsageError("--archive is for all of its cells", action="Name no cell, or leave it away")
    found, unreadable = _all(options.cells, console)
    for one in found:
        try:
            cell_status.publish_status(one)
        except FileError as error:
            console.warn(" ".join(str(error).split()))
    if options.metrics is not None:
        options.metrics.write(metrics_text(found).encode(), for_everybody=True)
    broken = [{"cell": path, "error": str(error)} for path, error in unreadable.items()]
    document = {"cells": [status_document(one) for one in found], "unreadable": broken}
    console.show(document, status_text(found, unreadable))
    return ExitCode.USAGE if unreadable else ExitCode.DONE


def _all(
    paths: Sequence[Path], console: Console
) -> tuple[list[cell_status.CellStatus], dict[Path, HexacellError]]:
    """Every cell; one that is broken hides no other. What a pattern names beside them is left out."""
    found: list[cell_status.CellStatus] = []
    unreadable: dict[Path, HexacellError] = {}
    for path in paths:
        if len(paths) > 1 and not is_cell_file(path):
            continue
        try:
            with plugin_failures_named():
                found.append(cell_status.cell_status(cell_at(path, console)))
        except HexacellError as error:
            if len(paths) == 1:
                raise
            unreadable[path] = error
    return found, unreadable


def _fleet(options: argparse.Namespace, console: Console) -> ExitCode:
    if options.archive is None:
        raise UsageError("no cell is named", action="Name cell files, or --archive URL for all")
    if options.metrics is not None:
        raise UsageError("metrics are of cells of this computer", action="Name their cell files")
    found = cell_status.fleet_cells(archive_url(options.archive))
    cells = [one.model_dump(mode="json") | {"overdue": one.is_overdue} for one in found]
    console.show({"cells": cells}, fleet_text(found))
    return ExitCode.DONE


def status_text(found: Sequence[cell_status.CellStatus], unreadable: Mapping[Path, HexacellError]) -> str:
    """A line a cell, and below it what needs somebody; the broken ones at the end."""
    head = f"{'cell':{LONGEST_NAME}} {'latest verdict':17} {'error, mm':16} {'when':17} in use"
    lines = [head, *(line for one in found for line in _lines(one))]
    for path, error in unreadable.items():
        lines += [f"{path.name[:LONGEST_NAME]:{LONGEST_NAME}} cannot be read", indent(str(error), "  ")]
    return "\n".join(lines)


def metrics_text(found: Sequence[cell_status.CellStatus]) -> str:
    """All samples, those of one metric together, each with its help."""
    samples: dict[str, list[str]] = {name: [] for name in HELP}
    for one in found:
        for name, labels, value in _samples(one):
            named = {"cell": one.cell.settings.name, **labels}
            shown = ",".join(f'{label}="{escaped(text)}"' for label, text in named.items())
            samples[name].append(f"{name}{{{shown}}} {value}")
    return "".join(
        f"# HELP {name} {HELP[name]}\n# TYPE {name} gauge\n" + "".join(f"{line}\n" for line in lines)
        for name, lines in samples.items()
        if lines
    )


def escaped(text: str) -> str:
    """A text as a value of a metric's label has it."""
    return printable(text).translate(ESCAPES)


def _lines(one: cell_status.CellStatus) -> Iterator[str]:
    figures, latest = one.figures, one.latest
    verdict, error = verdict_word(figures.verdict), figure_with_u(figures.position_mm, figures.expanded_mm)
    when, used = minute(figures.judged_at), "no" if one.in_use_by is None else f"by {one.in_use_by}"
    yield f"{figures.name[:LONGEST_NAME]:{LONGEST_NAME}} {verdict:17} {error:16} {when:17} {used}"
    if one.proposal is not None:
        yield f"  a proposal waits for a person: hexacell apply {one.proposal.folder.path}"
    if latest is not None and not (latest.summary.has_begun and latest.summary.is_over):
        yield f"  {latest.name}: {latest.summary.line}"
    if one.ends_in_future is not None:
        yield f"  {one.ends_in_future.name} ended in the future: this computer's clock is wrong, or was"
    yield from _due_line(figures)
    if one.drift.changes:
        last = one.drift.changes[-1]
        noticed = f"noticed on {last.noticed:%Y-%m-%d}"
        yield f"  leg {legs_text(last)} changed, {noticed}; hexacell history --drift shows more"


def status_document(one: cell_status.CellStatus) -> dict[str, Any]:
    """What ``status --json`` prints of a cell."""
    worst = one.worst_share
    return one.figures.model_dump(exclude={"host", "seen_at", "latest_run", "latest_at", "mode"}) | {
        "cell": one.cell.path,
        "in_use_by": one.in_use_by,
        "in_force": one.in_force and one.in_force.folder.path,
        "proposal": one.proposal and one.proposal.folder.path,
        "not_begun": one.latest.summary.line if one.latest and not one.latest.summary.has_begun else None,
        "largest_sum": worst and {"parameter": worst[0], "ratio": worst[1]},
    }


def _samples(one: cell_status.CellStatus) -> Iterator[tuple[str, dict[str, str], str]]:
    yield "hexacell_in_use", {}, str(int(one.in_use_by is not None))
    yield "hexacell_open_proposal", {}, str(int(one.proposal is not None))
    yield "hexacell_changes_found", {}, str(len(one.drift.changes))
    if one.latest is not None:
        yield "hexacell_last_run_begun", {}, str(int(one.latest.summary.has_begun))
    times = {
        "hexacell_last_run_timestamp_seconds": cell_status.summary_of(one.latest).ended,
        "hexacell_last_pass_timestamp_seconds": one.figures.passed_at,
        "hexacell_calibration_timestamp_seconds": cell_status.summary_of(one.in_force).ended,
        "hexacell_calibration_due_timestamp_seconds": one.figures.due_at,
    }
    yield from ((name, {}, repr(at.timestamp())) for name, at in times.items() if at is not None)
    if (worst := one.worst_share) is not None:
        yield "hexacell_largest_sum_ratio", {"parameter": worst[0]}, repr(worst[1])
    if one.judged is None:
        return
    verdict, position = one.judged.summary.verdict, one.judged.summary.position
    yield "hexacell_last_run_passed", {}, str(int(verdict is Verdict.PASS))
    for each in Verdict:
        yield "hexacell_last_verdict", {"verdict": each.value}, str(int(each is verdict))
    if position is not None:
        yield "hexacell_position_error_mm", {}, repr(position.value)
        if position.expanded is not None:
            yield "hexacell_position_expanded_mm", {}, repr(position.expanded)
        yield "hexacell_position_limit_mm", {}, repr(position.limit)


def fleet_text(cells: Sequence[cell_status.FleetCell]) -> str:
    """A line a cell of an archive, of at most 80 columns, and below it what needs somebody."""
    if not cells:
        return NO_CELLS
    head = _fleet_columns("cell", "host", "latest verdict", "error, mm", "last run")
    return "\n".join([head, *(line for one in cells for line in _fleet_cell_lines(one))])


def _fleet_cell_lines(one: cell_status.FleetCell) -> Iterator[str]:
    error = figure_with_u(one.position_mm, one.expanded_mm)
    yield _fleet_columns(one.name, one.host, verdict_word(one.verdict), error, minute(one.latest_at))
    yield from _due_line(one)
    if one.proposal is not None:
        yield f"  a proposal waits for a person: {one.proposal}, on {one.host}"
    if one.changes:
        yield "  the robot has changed; hexacell history --drift on its computer shows more"


def _due_line(one: cell_status.FleetCell) -> Iterator[str]:
    if one.due_at is not None:
        yield f"  calibration {'OVERDUE since' if one.is_overdue else 'due on'} {one.due_at:%Y-%m-%d}"


def fleet_history_text(runs: Sequence[cell_status.FleetRun]) -> str:
    """A line a run of an archive."""
    if not runs:
        return NO_FLEET_RUNS
    lines = [_fleet_columns("cell", "host", "verdict", "error, mm", "ended")]
    for one in runs:
        verdict, error = verdict_word(one.summary.verdict), error_with_u(one.summary.accuracy)
        lines.append(_fleet_columns(one.cell, one.host, verdict, error, minute(one.summary.ended)))
    return "\n".join(lines)


def _fleet_columns(cell: str, host: str, verdict: str, error: str, when: str) -> str:
    return f"{cell[:18]:18} {host[:11]:11} {verdict:16} {error:15} {when}".rstrip()
