"""Arguments of the commands around unattended runs, for cell files, and for results and their history."""

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.commands import (
    LARGEST_NODE_ID,
    Parser,
    add_command,
    add_parser,
    bounded_seconds,
    whole_number,
)

SHELLS = ("bash", "zsh", "fish")


def add_operation_commands(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    """Add these commands to a parser."""
    for add in (
        _apply,
        _rollback,
        _history,
        _report,
        _devices,
        _schedule,
        _status,
        _notify,
        _serve,
        _cell,
        _completion,
    ):
        add(commands)


def _devices(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "devices", "find gauges, encoders, a controller; text for a cell file")
    parser.add_argument(
        "ports", nargs="*", metavar="PORT", help="serial ports or URLs (default: all of this computer)"
    )
    parser.add_argument(
        "--can",
        action="append",
        default=[],
        metavar="BUS",
        help="a CAN bus, such as interface=slcan,channel=/dev/ttyACM0,bitrate=500000",
    )
    parser.add_argument(
        "--bitrate",
        type=int,
        default=500_000,
        metavar="BIT/S",
        help="of CAN adapters that are found (default: %(default)s)",
    )
    parser.add_argument(
        "--controller",
        default="127.0.0.1:5007",
        metavar="HOST:PORT",
        help="where LinuxCNC's server may be (default: %(default)s)",
    )
    parser.add_argument(
        "--set-node",
        type=whole_number(1, LARGEST_NODE_ID),
        metavar="ID",
        help="give the only device on a CAN bus this node id (LSS), after a question",
    )
    parser.add_file("--write", "write a cell file: what was found, and your answers to the rest")
    parser.add_argument("--diagnose", metavar="NAME", help="watch a gauge, or encoders, of --cell")
    parser.add_argument("--cell", type=Path, metavar="CELL", help="the cell file (TOML) of --diagnose")
    parser.add_argument(
        "--seconds",
        type=bounded_seconds,
        default=10.0,
        metavar="S",
        help="how long --diagnose watches (default: %(default)s)",
    )
    parser.add_json()


def _schedule(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands,
        "schedule",
        "have a cell checked each day: systemd units or a crontab line",
        "unattended.schedule",
    )
    parser.add_cell()
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--daily", metavar="HH:MM", help="write the units: a run each day at this time")
    what.add_argument("--show", action="store_true", help="show the units of this cell")
    what.add_argument("--remove", action="store_true", help="remove them")
    parser.add_argument(
        "--mode",
        choices=("check", "quick", "optimise"),
        default="check",
        help="check: change nothing (default); quick: correct what has drifted, optimise: recalibrate, "
        "and apply only within the limits",
    )
    parser.add_argument("--on-failure", metavar="UNIT", help="unit that systemd starts after a failure")
    parser.add_file("--metrics", "write metrics of the cell there after each run")
    parser.add_argument("--cron", action="store_true", help="print a crontab line instead")
    parser.add_argument("--folder", type=Path, metavar="FOLDER", help="where the units are, if elsewhere")
    parser.add_json()


def _status(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "status", "all cells at a glance: verdicts, and what waits for a person")
    parser.add_argument("cells", type=Path, nargs="*", metavar="CELL", help="cell files (TOML)")
    parser.add_archive("instead of cell files: all cells that share this archive")
    parser.add_file("--metrics", "write it as metrics for Prometheus' node exporter too")
    parser.add_json()


def _notify(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "notify", "who hears of unattended runs: list, try, send what waits", "unattended.notify"
    )
    parser.add_cell()
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--test", action="store_true", help="notify everybody of a test now")
    what.add_argument("--send", action="store_true", help="send what earlier runs could not")
    parser.add_json()


def _serve(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "serve", "serve the results of a cell by OPC UA until interrupted", "serve.results"
    )
    parser.add_cell()


def _cell(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "cell", "validate or show a cell file, or print its schema")
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True, dest="action")
    validate = add_parser(actions, "validate", "check it; every mistake with its line")
    validate.add_cell()
    validate.add_json()
    schema = add_parser(
        actions, "schema", "print the JSON Schema of cell files, for editors and other programs"
    )
    schema.add_json()
    show = add_parser(actions, "show", "print it with defaults filled in, and the origin of each value")
    show.add_cell()
    show.add_json()


def _completion(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "completion", "print a script that lets a shell complete commands and files"
    )
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"one of {', '.join(SHELLS)}")


def _apply(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "apply", "write the proposal of a run into the controller's config", "config.apply_run"
    )
    parser.add_run()
    _add_reason(parser)
    parser.add_json()


def _rollback(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "rollback", "undo what was written into the controller's config", "config.rollback_config"
    )
    parser.add_cell()
    parser.add_argument(
        "--to",
        metavar="RUN",
        help="restore what this run wrote, by its folder or name (default: undo the latest write)",
    )
    _add_reason(parser)
    parser.add_json()


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
    parser.add_archive(
        "the index over the runs: postgresql://user@host/database (default: as [archive] has it)"
    )
    parser.add_json()


def _report(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "report", "write the report of a run: one file to read, print and file", "recorded.report"
    )
    parser.add_run()
    parser.add_file(
        "--output",
        "where to (default: report.html in the run folder); .pdf gives PDF/A, .xml a Digital Calibration "
        "Certificate",
    )
    parser.add_argument(
        "--compare", type=Path, metavar="RUN", help="say also what has changed since this run, a folder"
    )
    parser.add_json()
