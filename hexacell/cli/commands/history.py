"""``hexacell history``: the runs of a cell, two of them compared, what drifts, and writes of its config."""

import argparse
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from hexacell.cell.loader import Cell, load_cell
from hexacell.cli.commands.cell import archive_url, cell_at
from hexacell.cli.commands.status import fleet_history_text
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, HexacellError, UsageError
from hexacell.results.run_comparison import ParameterTrend, RunComparison
from hexacell.runs.run_folder import RunFolder, find_run
from hexacell.services.history import past_runs
from hexacell.services.history.cell_status import fleet_runs
from hexacell.services.history.drift_history import DriftHistory, drift_history
from hexacell.services.history.run_index import RunIndex
from hexacell.services.write_back.config_history import ConfigWrite, config_history
from hexacell.text.config_changes import NO_WRITES, write_text
from hexacell.text.history import comparison_text, drift_text, history_text, retention_text, watch_text
from hexacell.text.layout import wrapped
from hexacell.text.line_face import run_story, story_text
from hexacell.text.time_spent import spent_sentence
from procedures.journal.journal import read_entries
from procedures.journal.time_spent import time_spent
from procedures.run.state import fold

MOST_DAYS = 36525.0


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """List, compare, or look for drift; nothing is changed but by ``--delete``."""
    if options.delete and options.keep is None:
        raise UsageError("--delete needs --keep DAYS", action="Say how old the runs are that may go")
    if options.cell is None:
        return _fleet(options, console)
    cell = cell_at(options.cell, console)
    if options.compare is not None:
        compared = past_runs.compare_runs(cell, *options.compare)
        console.show(_comparison_document(*compared), comparison_text(*compared))
    elif options.show is not None:
        run = find_run(cell, options.show)
        entries = read_entries(run.journal)
        if not entries:
            raise UsageError("nothing happened in this run", subject=run.path, action="Name another")
        told = [
            {"line": entry.number, "at": entry.at, "kind": entry.event.kind, "text": text}
            for entry, text in run_story(entries)
        ]
        document: dict[str, Any] = {"events": told}
        text = story_text(entries)
        with suppress(
            HexacellError
        ):  # the cell file of an older program may have what this one does not know
            settings = load_cell(run.cell_file).settings
            spent, begun = time_spent(entries, settings.timing), fold(one.event for one in entries).started
            document |= {"seconds": spent}
            text += "\n" + wrapped(spent_sentence(spent, settings, begun.mode if begun else ""))
        console.show(document, text)
    elif options.keep is not None:
        _keep(cell, options, console)
    elif options.changes:
        _changes(cell, console)
    elif options.drift:
        index = _index(cell, options, console)
        found, watched = (
            past_runs.parameter_trends(cell, past_runs.past_runs(cell, index), index),
            drift_history(cell, index),
        )
        console.show(
            _drift_document(found, watched),
            "\n".join(filter(None, [watch_text(watched), drift_text(found)])),
        )
    else:
        runs = past_runs.past_runs(cell, _index(cell, options, console))
        listed = [
            {"run": one.folder.path, "in_controller": one.is_in_controller, **one.summary.document}
            for one in runs
        ]
        console.show({"runs": listed}, history_text(runs))
    return ExitCode.DONE


def _index(cell: Cell, options: argparse.Namespace, console: Console) -> RunIndex:
    """The index of the archive that the command or the cell file names."""
    url = None if options.archive is None else archive_url(options.archive)
    return RunIndex(cell, url, console.warn)


def _fleet(options: argparse.Namespace, console: Console) -> ExitCode:
    named = (options.compare, options.show, options.keep)
    is_one_cells = options.drift or options.changes or any(one is not None for one in named)
    if options.archive is None or is_one_cells:
        raise UsageError("no cell is named", action="Name a cell file, or --archive URL for all")
    runs = fleet_runs(archive_url(options.archive))
    listed = [{"cell": one.cell, "host": one.host, "run": one.name, **one.summary.document} for one in runs]
    console.show({"runs": listed}, fleet_history_text(runs))
    return ExitCode.DONE


def _keep(cell: Cell, options: argparse.Namespace, console: Console) -> None:
    """Say which old runs may go, and delete them if that is asked for."""
    if not 0.0 <= options.keep <= MOST_DAYS:
        raise UsageError("--keep takes a number of days", action=f"Write one from 0 to {MOST_DAYS:g}")
    found = past_runs.retention(cell, options.keep, _index(cell, options, console))
    if options.delete:
        past_runs.delete_runs(cell, found.leaving)
    document = {
        "before": found.before,
        "deleted": options.delete,
        "runs": [run.folder.path for run in found.leaving],
        "kept": [{"run": run.folder.path, "reason": reason} for run, reason in found.kept],
    }
    console.show(document, retention_text(found, is_deleted=options.delete))


def _changes(cell: Cell, console: Console) -> None:
    found = config_history(cell)
    for line in found.damaged:
        console.warn(f"{found.path}, line {line}: this record is torn, damaged or newer, and left out")
    writes = [_write_document(one) for one in found.writes]
    text = "\n".join(map(write_text, found.writes)) or NO_WRITES
    console.show({"changes": writes, "damaged_lines": found.damaged}, text)


def _comparison_document(before: RunFolder, after: RunFolder, compared: RunComparison) -> dict[str, Any]:
    return {
        "before": before.path,
        "after": after.path,
        "frame": compared.frame,
        "changed": compared.is_changed,
        "chi2": compared.test.chi2,
        "dof": compared.test.expected,
        "probability": compared.test.probability,
        "parameters": [
            {**asdict(one), "change": one.change, "significant": one.is_significant}
            for one in compared.parameters
        ],
    }


def _drift_document(found: Sequence[ParameterTrend], watched: DriftHistory) -> dict[str, Any]:
    return {
        "parameters": [{**asdict(one), "walking": one.is_walking} for one in found],
        "runs": watched.runs,
        "temperatures_c": watched.celsius,
        "changes": [
            asdict(one)
            | {
                "leg": one.possible_legs[0],
                "parameter": one.parameter.name,
                "unit": one.parameter.kind.unit,
            }
            for one in watched.changes
        ],
        "shares_of_limit": dict(watched.shares),
    }


def _write_document(write: ConfigWrite) -> dict[str, Any]:
    one = write.record
    known = one.model_dump(exclude={"version", "files", "why"})
    return {
        **{name: None if value == "" else value for name, value in known.items()},
        "config": one.files[0],
        "further_configs": one.files[1:],
        "verdict": write.verdict,
        "why": write.why or None,
        "recorded": write.is_recorded,
    }
