"""Arguments of the studies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.commands import add_command, add_json, add_parser, positive


def add_study_commands(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    """Add them to the commands of a parser."""
    parser = add_parser(commands, "study", "repeat what was published of the method, on simulated robots")
    studies = parser.add_subparsers(title="studies", metavar="STUDY", required=True)
    for name, summary in (
        ("paper", "figures 4 and 5 and table 2 of Abtahi et al. (2010)"),
        ("experiment", "its experiment, figures 8 and 9, by the robot's repeatability"),
    ):
        _study(studies, name, summary)


def _study(studies: Any, name: str, summary: str) -> None:  # noqa: ANN401
    parser = add_command(studies, name, summary, target=f"study.{name}")
    parser.add_argument(
        "--draws",
        type=positive,
        default=20,
        metavar="N",
        help="of orientations and noise, for each case (default: %(default)s)",
    )
    parser.add_argument(
        "--processes", type=positive, metavar="N", help="at a time (default: one for each processor)"
    )
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("hexacell-study"),
        help="keeps each result, so that a study can be interrupted, and gets a picture "
        "(default: %(default)s)",
    )
    add_json(parser)
