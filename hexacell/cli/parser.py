"""Arguments of all commands. Only the standard library is imported, so that ``--help`` is instant."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NoReturn

from hexacell import __version__
from hexacell.errors import UsageError

EXIT_CODES = """exit codes:
  0 done, within limits            4 an answer or approval is needed
  1 out of limits or worse,        5 the cell is in use
    nothing applied                6 write-back failed and was undone
  2 usage or file error            7 out of its time; it can be resumed
  3 hardware or link               70 a fault of the program
                                   130 interrupted"""


class Parser(argparse.ArgumentParser):
    """A parser that raises instead of exiting, so that every error is reported in the same form.

    Options cannot be abbreviated: an abbreviation that works today may be ambiguous tomorrow.
    """

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - argparse's own settings
        super().__init__(allow_abbrev=False, **settings)

    def error(self, message: str) -> NoReturn:
        """Raise ``UsageError`` with argparse's message."""
        raise UsageError(message, action=f"Try `{self.prog} --help`")


def make_parser() -> Parser:
    """The parser of all commands; ``options.target`` is the command's module and function.

    Its ``parse_args`` raises ``UsageError``.
    """
    parser = Parser(
        prog="hexacell",
        usage="hexacell [-h] [--version] COMMAND ...",
        description="Make a 6-DOF parallel robot accurate with three dial gauges and a ball.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"hexacell {__version__}")
    # argparse aligns the commands below with the metavar, which must be about as long as they are.
    commands = parser.add_subparsers(
        title="commands", prog="hexacell", metavar="COMMAND ...", required=True
    )
    _demo(commands)
    _run(commands)
    _tui(commands)
    _attach(commands)
    _length(commands)
    _preflight(commands)
    _simulate(commands)
    _host(commands)
    _next(commands)
    _fit(commands)
    _replay(commands)
    _apply(commands)
    _rollback(commands)
    _history(commands)
    _report(commands)
    _schedule(commands)
    _status(commands)
    _notify(commands)
    _serve(commands)
    _cell(commands)
    return parser


def _add(commands: Any, name: str, summary: str) -> Parser:  # noqa: ANN401 - argparse's own type is private
    parser: Parser = commands.add_parser(
        name, help=summary, description=summary[0].upper() + summary[1:] + "."
    )
    return parser


def _command(commands: Any, name: str, summary: str, target: str = "") -> Parser:  # noqa: ANN401
    parser = _add(commands, name, summary)
    parser.set_defaults(target=target or f"{name}.main")
    return parser


def _add_cell(parser: Parser) -> None:
    parser.add_argument("cell", type=Path, metavar="CELL", help="the cell file (TOML)")


def _add_json(parser: Parser) -> None:
    parser.add_argument(
        "--json", action="store_true", help="one JSON document on stdout; text goes to stderr"
    )


def _demo(commands: Any) -> None:  # noqa: ANN401
    parser = _command(
        commands, "demo", "do the whole job on a simulated cell, nothing attached", "run.demo"
    )
    parser.add_argument(
        "--config",
        default="simulated-hexaglide",
        metavar="NAME",
        help="one of the cells that come with hexacell (default: %(default)s)",
    )
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("hexacell-demo"),
        metavar="FOLDER",
        help="where to work; an earlier demo there is replaced (default: %(default)s)",
    )
    _add_json(parser)


def _run(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "run", "measure, identify, propose, write back and verify")
    _add_cell(parser)
    _add_resume(parser, "run")
    parser.add_argument("--unattended", action="store_true", help="no person can place gauges or approve")
    parser.add_argument(
        "--mode",
        choices=("check", "quick", "optimise"),
        help="check: measure until the error is decided, change nothing (default if unattended); "
        "quick: carry a check on to the accuracy of the last calibration, and write back; "
        "optimise: calibrate and write back (default otherwise)",
    )
    parser.add_argument(
        "--plan",
        action="store_true",
        help="show the poses of the plan first, each of which may be taken out",
    )
    parser.add_argument(
        "--length-check",
        action="store_true",
        help="check the length scale before the verdict, with the fixture of [length_check]; a resumed run "
        "has it if it was begun with it",
    )
    parser.add_argument(
        "--events",
        type=Path,
        metavar="FILE",
        help="write each event there, as a line of JSON, as it happens",
    )
    parser.add_argument(
        "--detachable",
        action="store_true",
        help="in a process of its own, which goes on when this terminal is left (see attach)",
    )
    _add_json(parser)


def _add_resume(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument(
        "--resume",
        metavar="RUN",
        nargs="?",
        const="latest",
        help=f"resume an interrupted {what}: its folder or name (default: the latest one)",
    )


def _tui(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "tui", "the technician's screen: measure, review, approve, roll back")
    _add_cell(parser)


def _attach(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "attach", "come back to a run that goes on without a terminal")
    _add_cell(parser)


def _length(commands: Any) -> None:  # noqa: ANN401
    parser = _command(
        commands, "length", "check the scale of the encoders against a known length", "run.length"
    )
    _add_cell(parser)
    _add_resume(parser, "check")
    parser.add_argument("--unattended", action="store_true", help="no person can mount the gauges")
    _add_json(parser)


def _preflight(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "preflight", "check everything that must hold before motion; moves nothing")
    _add_cell(parser)
    parser.add_argument("--unattended", action="store_true", help="check also that no person is needed")
    parser.add_argument(
        "--mode",
        choices=("quick", "optimise"),
        default="optimise",
        help="of the run: a calibration (default), or the quick level from the last result on",
    )
    _add_json(parser)


def _simulate(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "simulate", "serve a simulated cell to other processes until interrupted")
    _add_cell(parser)
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="write the cell file for `run` there instead of to stdout",
    )


def _host(commands: Any) -> None:  # noqa: ANN401
    """The process of a run. People never type it, so the help does not list it."""
    parser = commands.add_parser("host")
    parser.set_defaults(target="host.main")
    _add_cell(parser)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--mode", choices=("check", "quick", "optimise", "length"), required=True)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--length-check", action="store_true")
    parser.add_argument("--removed", type=Path, required=True)


def _next(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "next", "print the pose worth measuring next", "records.propose_next")
    _add_cell(parser)
    parser.add_argument(
        "--measurements", type=Path, required=True, metavar="FILE", help="the records so far (CSV)"
    )
    parser.add_argument(
        "--refused",
        type=_count,
        default=0,
        metavar="N",
        help="how many poses at this point could not be measured; proposes another",
    )
    _add_json(parser)


def _count(text: str) -> int:
    number = int(text)
    if number < 0:
        raise ValueError
    return number


def _fit(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "fit", "identify the geometry from a measurement file", "records.fit")
    _add_cell(parser)
    parser.add_argument(
        "--measurements", type=Path, required=True, metavar="FILE", help="the records (CSV)"
    )
    _add_json(parser)


def _replay(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "replay", "repeat a recorded run's decisions and results, and compare")
    parser.add_argument("run", type=Path, metavar="RUN", help="a run folder, or a journal")
    parser.add_argument(
        "--only",
        choices=("decisions", "results", "identification"),
        help="repeat only these, and take everything else as recorded",
    )
    parser.add_argument(
        "--tolerance",
        type=float,
        metavar="T",
        help="allowed difference of a number, relative above 1 (default: 1e-9)",
    )
    parser.add_argument(
        "--export",
        type=Path,
        metavar="FOLDER",
        help="replay nothing; copy the run folder there with every password masked, to be given to others",
    )
    _add_json(parser)


def _apply(commands: Any) -> None:  # noqa: ANN401
    parser = _command(
        commands, "apply", "write the proposal of a run into the controller's config", "config.apply_run"
    )
    parser.add_argument("run", type=Path, metavar="RUN", help="a run folder")
    _add_json(parser)


def _rollback(commands: Any) -> None:  # noqa: ANN401
    parser = _command(
        commands, "rollback", "undo what was written into the controller's config", "config.rollback_config"
    )
    _add_cell(parser)
    parser.add_argument(
        "--to",
        metavar="RUN",
        help="restore what this run wrote, by its folder or name (default: undo the latest write)",
    )
    _add_json(parser)


def _history(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "history", "list the runs of a cell, compare two, see what drifts")
    parser.usage = (
        "hexacell history [-h] [--compare RUN RUN | --show RUN | --refit RUN |\n"
        "                        --keep DAYS [--delete] | --drift] [--archive URL]\n"
        "                        [--json] [CELL]"
    )  # argparse does not break a group
    parser.add_argument(
        "cell", type=Path, nargs="?", metavar="CELL", help="the cell file; without it all of --archive"
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--compare",
        nargs=2,
        metavar=("RUN", "RUN"),
        help="what changed from one calibration to another, parameter by parameter",
    )
    what.add_argument("--show", metavar="RUN", help="what happened in a run, and when")
    what.add_argument(
        "--refit", metavar="RUN", help="identify a calibration again, with today's cell file and program"
    )
    what.add_argument(
        "--keep",
        type=float,
        metavar="DAYS",
        help="which runs that ended before may be deleted; those that wrote the config never may",
    )
    what.add_argument("--drift", action="store_true", help="the trend of every parameter over all runs")
    parser.add_argument("--delete", action="store_true", help="with --keep: delete those")
    parser.add_argument(
        "--archive",
        metavar="URL",
        help="the index over the runs: postgresql://user@host/database (default: as [archive] has it)",
    )
    _add_json(parser)


def _report(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "report", "write the report of a run: one file to read, print and file")
    parser.add_argument("run", type=Path, metavar="RUN", help="a run folder")
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="where to (default: report.html in the run folder); .pdf gives PDF/A, .xml a "
        "Digital Calibration Certificate",
    )
    parser.add_argument(
        "--compare", type=Path, metavar="RUN", help="say also what has changed since this run, a folder"
    )
    _add_json(parser)


def _schedule(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "schedule", "have a cell checked each day: systemd units or a crontab line")
    _add_cell(parser)
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
    for option, default, meaning in (
        ("--longest", 120, "stop a run in place after so long"),
        ("--retry", 15, "wait before another try"),
    ):
        parser.add_argument(
            option, type=int, default=default, metavar="MINUTES", help=f"{meaning} (default: %(default)s)"
        )
    parser.add_argument(
        "--retries",
        type=_count,
        default=3,
        metavar="N",
        help="how often, where a device or the lock is not there (default: %(default)s)",
    )
    parser.add_argument("--on-failure", metavar="UNIT", help="unit that systemd starts after a failure")
    parser.add_argument(
        "--metrics", type=Path, metavar="FILE", help="write metrics of the cell there after each run"
    )
    parser.add_argument("--cron", action="store_true", help="print a crontab line instead")
    parser.add_argument("--folder", type=Path, metavar="FOLDER", help="where the units are, if elsewhere")
    _add_json(parser)


def _status(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "status", "all cells at a glance: latest verdicts, what waits for a person")
    parser.add_argument("cells", type=Path, nargs="*", metavar="CELL", help="cell files (TOML)")
    parser.add_argument(
        "--archive", metavar="URL", help="instead of cell files: all cells that share this archive"
    )
    parser.add_argument(
        "--metrics", type=Path, metavar="FILE", help="write it as metrics for Prometheus' node exporter too"
    )
    _add_json(parser)


def _notify(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "notify", "who is told of unattended runs: list, try, send what waits")
    _add_cell(parser)
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--test", action="store_true", help="tell everybody something now")
    what.add_argument("--send", action="store_true", help="send what earlier runs could not")
    _add_json(parser)


def _serve(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "serve", "serve the results of a cell by OPC UA until interrupted")
    _add_cell(parser)


def _cell(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "cell", "validate or show a cell file, or print its schema")
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True, dest="action")
    validate = _add(actions, "validate", "check it; every mistake with its line")
    _add_cell(validate)
    _add_json(validate)
    schema = _add(actions, "schema", "print the JSON Schema of cell files, for editors and other programs")
    _add_json(schema)
    show = _add(actions, "show", "print it with defaults filled in, and the origin of each value")
    _add_cell(show)
    _add_json(show)
