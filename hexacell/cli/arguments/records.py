"""Arguments of the commands for records."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.commands import add_cell, add_command, add_file, add_json, add_run, not_negative


def add_record_commands(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    """Add those to the commands of a parser."""
    _next(commands)
    _fit(commands)
    _replay(commands)


def _next(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "next", "print the pose worth measuring next", "records.propose_next")
    add_cell(parser)
    add_file(parser, "--measurements", "the records so far (CSV)", is_required=True)
    parser.add_argument(
        "--refused",
        type=not_negative,
        default=0,
        metavar="N",
        help="how many poses at this point could not be measured; proposes another",
    )
    add_json(parser)


def _fit(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "fit", "identify the geometry from a measurement file", "records.fit")
    add_cell(parser)
    add_file(parser, "--measurements", "the records (CSV)", is_required=True)
    parser.add_argument(
        "--identify",
        choices=("all", "zeros"),
        help="all parameters, or the encoders' zeros alone (default: as the cell file says)",
    )
    add_json(parser)


def _replay(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "replay", "repeat a recorded run's decisions and results, and compare")
    add_run(parser, "a run folder, or a journal")
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
    add_json(parser)
