"""Arguments of the commands around unattended runs, for cell files, and for results and their history."""

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.commands import (
    LARGEST_NODE_ID,
    MODES,
    Parser,
    add_command,
    add_flag,
    add_output,
    add_parser,
    add_value,
    bounded_seconds,
    whole_number,
)
from hexacell.storage.output_files import METRICS, NEW_CELL, REPORT

SHELLS = ("bash", "zsh", "fish")


def _devices(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    parser = add_command(commands, "devices", "find gauges, encoders, a controller; text for a cell file")
    words = "serial ports or URLs (default: all of this computer)"
    parser.add_argument("ports", nargs="*", metavar="PORT", help=words)
    words = "a CAN bus, such as interface=slcan,channel=/dev/ttyACM0,bitrate=500000"
    parser.add_argument("--can", action="append", default=[], metavar="BUS", help=words)
    add_value(
        parser, "--controller", "HOST:PORT", "where LinuxCNC's server may be", default="127.0.0.1:5007"
    )
    words = "give the only device on a CAN bus this node id (LSS), after a question"
    add_value(parser, "--set-node", "ID", words, whole_number(1, LARGEST_NODE_ID))
    add_output(parser, "--write", NEW_CELL, "write a cell file: what was found, and your answers")
    add_value(parser, "--diagnose", "NAME", "watch a gauge, or encoders, of --cell")
    add_value(parser, "--cell", "CELL", "the cell file (TOML) of --diagnose", Path)
    add_value(parser, "--seconds", "S", "how long --diagnose watches", bounded_seconds, 10.0)
    parser.add_json()


def _schedule(commands: Any) -> None:  # noqa: ANN401
    summary = "have a cell checked each day, by units of systemd"
    parser = add_command(commands, "schedule", summary, "unattended.schedule")
    parser.add_cell()
    what = parser.add_mutually_exclusive_group()
    add_value(what, "--daily", "HH:MM", "write the units: a run each day at this time")
    add_flag(what, "--show", "show the units of this cell")
    add_flag(what, "--remove", "remove them")
    parser.add_argument(
        "--mode",
        choices=MODES,
        default="check",
        help="check: change nothing (default); quick: correct what has drifted, optimise: recalibrate, "
        "and apply only within the limits",
    )
    add_output(parser, "--metrics", METRICS, "write metrics of the cell there after each run")
    add_value(parser, "--folder", "FOLDER", "where the units are, if elsewhere", Path)
    parser.add_json()


def _status(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "status", "all cells at a glance: verdicts, and what waits for a person")
    parser.add_argument("cells", type=Path, nargs="*", metavar="CELL", help="cell files (TOML)")
    parser.add_archive("instead of cell files: all cells that share this archive")
    add_output(parser, "--metrics", METRICS, "write it as metrics for Prometheus' node exporter too")
    parser.add_json()


def _notify(commands: Any) -> None:  # noqa: ANN401
    summary = "who hears of unattended runs: list, try, send what waits"
    parser = add_command(commands, "notify", summary, "unattended.notify")
    parser.add_cell()
    what = parser.add_mutually_exclusive_group()
    add_flag(what, "--test", "notify everybody of a test now")
    add_flag(what, "--send", "send what earlier runs could not")
    parser.add_json()


def _serve(commands: Any) -> None:  # noqa: ANN401
    summary = "serve the results of a cell by OPC UA until interrupted"
    add_command(commands, "serve", summary, "serve.results").add_cell()


def _cell(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "cell", "validate or show a cell file, or print its schema")
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True, dest="action")
    for name, summary in (
        ("validate", "check it; every mistake with its line"),
        ("schema", "print the JSON Schema of cell files, for editors and other programs"),
        ("show", "print it with defaults filled in, and the origin of each value"),
    ):
        action = add_parser(actions, name, summary)
        if name != "schema":
            action.add_cell()
        action.add_json()


def _completion(commands: Any) -> None:  # noqa: ANN401
    summary = "print a script that lets a shell complete commands and files"
    parser = add_command(commands, "completion", summary)
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"one of {', '.join(SHELLS)}")


def _apply(commands: Any) -> None:  # noqa: ANN401
    summary = "write the proposal of a run into the controller's config"
    parser = add_command(commands, "apply", summary, "config.apply_run")
    parser.add_run()
    _add_reason(parser)
    parser.add_json()


def _rollback(commands: Any) -> None:  # noqa: ANN401
    summary = "undo what was written into the controller's config"
    parser = add_command(commands, "rollback", summary, "config.rollback_config")
    parser.add_cell()
    words = "restore what this run wrote, by its folder or name (default: undo the latest write)"
    add_value(parser, "--to", "RUN", words)
    _add_reason(parser)
    parser.add_json()


def _add_reason(parser: Parser) -> None:
    words = "why, for `history --changes`: one line of text"
    parser.add_argument("--reason", default="", metavar="TEXT", help=words)


def _history(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "history", "list the runs of a cell, compare two, see what drifts")
    parser.usage = (
        "hexacell history [-h] [--compare RUN RUN | --show RUN |\n"
        "                        --keep DAYS [--delete] | --drift | --changes]\n"
        "                        [--archive URL] [--json] [CELL]"
    )  # argparse does not break a group
    words = "the cell file; without it all of --archive"
    parser.add_argument("cell", type=Path, nargs="?", metavar="CELL", help=words)
    what = parser.add_mutually_exclusive_group()
    words = "what changed from one run to another, parameter by parameter"
    what.add_argument("--compare", nargs=2, metavar=("RUN", "RUN"), help=words)
    add_value(what, "--show", "RUN", "what happened in a run, and when")
    words = "which runs that ended before may be deleted; those that wrote the config never may"
    add_value(what, "--keep", "DAYS", words, float)
    add_flag(what, "--drift", "the trend of every parameter over all runs")
    add_flag(what, "--changes", "every write into the controller's config: when, who, what and why")
    add_flag(parser, "--delete", "with --keep: delete those")
    parser.add_archive(
        "the index over the runs: postgresql://user@host/database (default: as [archive] has it)"
    )
    parser.add_json()


def _report(commands: Any) -> None:  # noqa: ANN401
    summary = "write the report of a run: one file to read, print and file"
    parser = add_command(commands, "report", summary, "recorded.report")
    parser.add_run()
    add_output(
        parser,
        "--output",
        REPORT,
        "where to (default: report.html in the run folder); .pdf gives PDF/A, .xml a Digital Calibration "
        "Certificate",
    )
    add_value(parser, "--compare", "RUN", "say also what has changed since this run, a folder", Path)
    parser.add_json()


RESULT_COMMANDS = (_apply, _rollback, _history, _report)
OPERATION_COMMANDS = (_devices, _schedule, _status, _notify, _serve, _cell, _completion)
"""What adds them to a parser."""
