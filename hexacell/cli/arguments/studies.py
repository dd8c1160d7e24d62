"""Arguments of the studies."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from hexacell.cli.arguments.commands import add_command, add_json, add_parser, positive


class _StudyArguments(NamedTuple):
    name: str
    summary: str
    draws: int
    drawn: str


STUDIES = (
    _StudyArguments(
        "paper",
        "figures 4 and 5 and table 2 of Abtahi et al. (2010)",
        20,
        "of orientations and noise, for each case",
    ),
    _StudyArguments(
        "experiment",
        "its experiment, figures 8 and 9, by the robot's repeatability",
        20,
        "of orientations and noise, for each case",
    ),
    _StudyArguments(
        "design",
        "accuracy by records, choice of orientations, travel, tilt, noise and points",
        20,
        "robots, each measured in every way",
    ),
)
"""Each a row of ``hexacell.text.studies``, which would take long to import here."""


def add_study_commands(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    """Add them to the commands of a parser."""
    parser = add_parser(commands, "study", "repeat what was published of the method, on simulated robots")
    studies = parser.add_subparsers(title="studies", metavar="STUDY", required=True)
    for study in STUDIES:
        _add_study(studies, study)


def _add_study(studies: Any, study: _StudyArguments) -> None:  # noqa: ANN401
    parser = add_command(studies, study.name, study.summary, target="study.main")
    parser.set_defaults(study=study.name)
    parser.add_argument(
        "--draws",
        type=positive,
        default=study.draws,
        metavar="N",
        help=f"{study.drawn} (default: %(default)s)",
    )
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument(
        "--processes", type=positive, metavar="N", help="at a time (default: one for each processor)"
    )
    workers.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster, tcp://HOST:PORT, instead of processes"
    )
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("hexacell-study"),
        help="keeps each result, so that a study can be interrupted, and gets a picture "
        "(default: %(default)s)",
    )
    add_json(parser)
