"""Arguments of the commands for results and the history of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.commands import (
    Parser,
    add_archive,
    add_cell,
    add_command,
    add_file,
    add_json,
    add_run,
)


def add_result_commands(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    """Add those to the commands of a parser."""
    _apply(commands)
    _rollback(commands)
    _history(commands)
    _report(commands)


def _apply(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "apply", "write the proposal of a run into the controller's config", "config.apply_run"
    )
    add_run(parser)
    _add_reason(parser)
    add_json(parser)


def _rollback(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "rollback", "undo what was written into the controller's config", "config.rollback_config"
    )
    add_cell(parser)
    parser.add_argument(
        "--to",
        metavar="RUN",
        help="restore what this run wrote, by its folder or name (default: undo the latest write)",
    )
    _add_reason(parser)
    add_json(parser)


def _add_reason(parser: Parser) -> None:
    parser.add_argument(
        "--reason", default="", metavar="TEXT", help="why, for `history --changes`: one line of text"
    )


def _history(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "history", "list the runs of a cell, compare two, see what drifts")
    parser.usage = (
        "hexacell history [-h] [--compare RUN RUN | --show RUN |\n"
        "                        --keep DAYS [--delete] | --drift | --changes]\n"
        "                        [--archive URL] [--json] [CELL]"
    )  # argparse does not break a group
    parser.add_argument(
        "cell", type=Path, nargs="?", metavar="CELL", help="the cell file; without it all of --archive"
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--compare",
        nargs=2,
        metavar=("RUN", "RUN"),
        help="what changed from one run to another, parameter by parameter",
    )
    what.add_argument("--show", metavar="RUN", help="what happened in a run, and when")
    what.add_argument(
        "--keep",
        type=float,
        metavar="DAYS",
        help="which runs that ended before may be deleted; those that wrote the config never may",
    )
    what.add_argument("--drift", action="store_true", help="the trend of every parameter over all runs")
    what.add_argument(
        "--changes",
        action="store_true",
        help="every write into the controller's config: when, who, what and why",
    )
    parser.add_argument("--delete", action="store_true", help="with --keep: delete those")
    add_archive(
        parser, "the index over the runs: postgresql://user@host/database (default: as [archive] has it)"
    )
    add_json(parser)


def _report(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "report", "write the report of a run: one file to read, print and file")
    add_run(parser)
    add_file(
        parser,
        "--output",
        "where to (default: report.html in the run folder); .pdf gives PDF/A, .xml a Digital Calibration "
        "Certificate",
    )
    parser.add_argument(
        "--compare", type=Path, metavar="RUN", help="say also what has changed since this run, a folder"
    )
    add_json(parser)
