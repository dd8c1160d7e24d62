"""What can be typed. Only the standard library is imported here, so that ``--help`` is instant."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hexacell import __version__

EXIT_CODES = """exit codes:
  0 done, within limits            4 an answer or approval is needed
  1 out of limits or worse,        5 the cell is in use
    nothing applied                6 write-back failed and was undone
  2 usage or file error            130 interrupted
  3 hardware or link"""


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands; ``options.module`` names the command's module."""
    parser = argparse.ArgumentParser(
        prog="hexacell",
        description="Make a 6-DOF parallel robot accurate with three dial gauges and a ball.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"hexacell {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _demo(commands)
    _run(commands)
    _preflight(commands)
    _simulate(commands)
    _fit(commands)
    _cell(commands)
    return parser


def _command(commands: Any, name: str, words: str) -> argparse.ArgumentParser:  # noqa: ANN401 - argparse's own type is private
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=words, description=words[0].upper() + words[1:] + "."
    )
    parser.set_defaults(module=name)
    return parser


def _add_cell(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("cell", type=Path, metavar="CELL", help="the cell file (TOML)")


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--json", action="store_true", help="one JSON document on stdout; words go to stderr"
    )


def _demo(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "demo", "do the whole job on a simulated cell, nothing attached")
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
        help="where to work; a former demo there is replaced (default: %(default)s)",
    )
    _add_json(parser)


def _run(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "run", "measure, identify, verify, propose and write back")
    _add_cell(parser)
    parser.add_argument("--resume", metavar="RUN", help="go on with an interrupted run: its folder or name")
    parser.add_argument("--unattended", action="store_true", help="nobody is there to place or approve")
    parser.add_argument(
        "--mode",
        choices=("check", "optimise"),
        help="check: measure held-out poses, touch nothing (default if unattended); "
        "optimise: calibrate and write back (default otherwise)",
    )
    _add_json(parser)


def _preflight(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "preflight", "check everything that must hold before motion; moves nothing")
    _add_cell(parser)
    parser.add_argument("--unattended", action="store_true", help="also that nobody is needed")
    _add_json(parser)


def _simulate(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "simulate", "serve a simulated cell to other processes until interrupted")
    _add_cell(parser)
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="write the cell file that `run` accepts there instead of stdout",
    )


def _fit(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "fit", "identify the geometry from a measurement file")
    _add_cell(parser)
    parser.add_argument("--measurements", type=Path, required=True, metavar="FILE", help="CSV")
    _add_json(parser)


def _cell(commands: Any) -> None:  # noqa: ANN401
    parser = _command(commands, "cell", "check, explain or show a cell file")
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True, dest="action")
    validate = actions.add_parser(
        "validate", help="say whether it is in order; every mistake with its line"
    )
    _add_cell(validate)
    _add_json(validate)
    schema = actions.add_parser("schema", help="print its JSON Schema")
    _add_json(schema)
    show = actions.add_parser("show", help="print it with defaults filled in, and where each value is from")
    _add_cell(show)
    _add_json(show)
