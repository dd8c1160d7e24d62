"""Arguments of the commands that measure, or show a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.commands import add_cell, add_command, add_file, add_json, add_resume


def add_run_commands(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    """Add those to the commands of a parser."""
    _demo(commands)
    _run(commands)
    _tui(commands)
    _length(commands)
    _preflight(commands)
    _simulate(commands)
    _host(commands)


def _demo(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
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
    add_json(parser)


def _run(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "run", "measure, identify, propose, write back and verify")
    add_cell(parser)
    add_resume(parser, "run")
    parser.add_argument("--unattended", action="store_true", help="no person can place gauges or approve")
    parser.add_argument(
        "--mode",
        choices=("check", "quick", "optimise"),
        help="check: measure until the error is decided, change nothing (default if unattended); "
        "quick: carry a check on to the accuracy of the last calibration, and write back; "
        "optimise: calibrate and write back (default otherwise)",
    )
    parser.add_argument(
        "--length-check",
        action="store_true",
        help="check the length scale before the verdict, with the fixture of [length_check]; a resumed run "
        "has it if it was begun with it",
    )
    add_file(parser, "--events", "write each event there, as a line of JSON, as it happens")
    add_json(parser)


def _tui(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "tui", "the technician's screen: measure, review, approve, roll back")
    add_cell(parser)


def _length(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "length", "check the scale of the encoders against a known length", "run.length"
    )
    add_cell(parser)
    add_resume(parser, "check")
    parser.add_argument("--unattended", action="store_true", help="no person can mount the gauges")
    add_json(parser)


def _preflight(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "preflight", "check everything that must hold before motion; moves nothing"
    )
    add_cell(parser)
    parser.add_argument("--unattended", action="store_true", help="check also that no person is needed")
    parser.add_argument(
        "--mode",
        choices=("quick", "optimise"),
        default="optimise",
        help="of the run: a calibration (default), or the quick level from the last result on",
    )
    add_json(parser)


def _simulate(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "simulate", "serve a simulated cell to other processes until interrupted"
    )
    add_cell(parser)
    add_file(parser, "--output", "write the cell file for `run` there instead of to stdout")
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="KIND:DEVICE@MOVE",
        help='inject a fault, such as "damaged:x@12": of gauge x, with move 12; without @12 at once',
    )


def _host(commands: Any) -> None:  # noqa: ANN401
    """The process of a run. People never type it, so the help does not list it."""
    parser = commands.add_parser("host")
    parser.set_defaults(target="host.main")
    add_cell(parser)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--mode", choices=("check", "quick", "optimise", "length"), required=True)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--length-check", action="store_true")
