"""Arguments of the commands that measure, show a run, or work on records, and of the studies."""

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.commands import add_command, add_parser, whole_number


def add_run_commands(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    """Add these commands to a parser."""
    for add in (_demo, _run, _tui, _length, _preflight, _simulate, _host, _next, _fit, _replay):
        add(commands)


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
    parser.add_json()


def _run(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "run", "measure, identify, propose, write back and verify")
    parser.add_cell()
    parser.add_resume("run")
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
    parser.add_file("--events", "write each event there, as a line of JSON, as it happens")
    parser.add_json()


def _tui(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "tui", "the technician's screen: measure, review, approve, roll back")
    parser.add_cell()


def _length(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "length", "check the scale of the encoders against a known length", "run.length"
    )
    parser.add_cell()
    parser.add_resume("check")
    parser.add_argument("--unattended", action="store_true", help="no person can mount the gauges")
    parser.add_json()


def _preflight(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands, "preflight", "check everything that must hold before motion; moves nothing"
    )
    parser.add_cell()
    parser.add_argument("--unattended", action="store_true", help="check also that no person is needed")
    parser.add_argument(
        "--mode",
        choices=("quick", "optimise"),
        default="optimise",
        help="of the run: a calibration (default), or the quick level from the last result on",
    )
    parser.add_json()


def _simulate(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands,
        "simulate",
        "serve a simulated cell to other processes until interrupted",
        "serve.simulate",
    )
    parser.add_cell()
    parser.add_file("--output", "write the cell file for `run` there instead of to stdout")
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
    parser.add_cell()
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--mode", choices=("check", "quick", "optimise", "length"), required=True)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--length-check", action="store_true")


def _next(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "next", "print the pose worth measuring next", "records.propose_next")
    parser.add_cell()
    parser.add_file("--measurements", "the records so far (CSV)", is_required=True)
    parser.add_argument(
        "--refused",
        type=whole_number(0),
        default=0,
        metavar="N",
        help="how many poses at this point could not be measured; proposes another",
    )
    parser.add_json()


def _fit(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "fit", "identify the geometry from a measurement file", "records.fit")
    parser.add_cell()
    parser.add_file("--measurements", "the records (CSV)", is_required=True)
    parser.add_argument(
        "--identify",
        choices=("all", "zeros"),
        help="all parameters, or the encoders' zeros alone (default: as the cell file says)",
    )
    parser.add_json()


def _replay(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(
        commands,
        "replay",
        "repeat a recorded run's decisions and results, and compare",
        "recorded.replay_run",
    )
    parser.add_run("a run folder, or a journal")
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
    parser.add_json()


_EACH_CASE = "of orientations and noise, for each case"
STUDIES = (
    ("paper", "figures 4 and 5 and table 2 of Abtahi et al. (2010)", _EACH_CASE),
    ("experiment", "its experiment, figures 8 and 9, by the robot's repeatability", _EACH_CASE),
    (
        "design",
        "accuracy by records, choice of orientations, travel, tilt, noise and points",
        "robots, each measured in every way",
    ),
)
"""Name, summary, and what is drawn; each a row of ``hexacell.text.studies``, which takes long to import."""


def add_study_commands(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    """Add the studies to the commands of a parser."""
    parser = add_parser(commands, "study", "repeat what was published of the method, on simulated robots")
    studies = parser.add_subparsers(title="studies", metavar="STUDY", required=True)
    for name, summary, drawn in STUDIES:
        _add_study(studies, name, summary, drawn)


def _add_study(studies: Any, name: str, summary: str, drawn: str) -> None:  # noqa: ANN401
    parser = add_command(studies, name, summary, target="study.main")
    parser.set_defaults(study=name)
    parser.add_argument(
        "--draws", type=whole_number(1), default=20, metavar="N", help=f"{drawn} (default: %(default)s)"
    )
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument(
        "--processes", type=whole_number(1), metavar="N", help="at a time (default: one for each processor)"
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
    parser.add_json()
