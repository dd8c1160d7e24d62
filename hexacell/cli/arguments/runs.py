"""Arguments of the commands that measure, show a run, or work on records, and of the studies."""

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.commands import (
    MODES,
    Parser,
    add_command,
    add_flag,
    add_output,
    add_parser,
    add_value,
    whole_number,
)
from hexacell.storage.output_files import EVENTS, SERVED_CELL


def _demo(commands: Any) -> None:  # noqa: ANN401 - argparse's own type is private
    summary = "do the whole job on a simulated cell, nothing attached"
    parser = add_command(commands, "demo", summary, "run.demo")
    words = "one of the cells that come with hexacell"
    add_value(parser, "--config", "NAME", words, default="simulated-hexaglide")
    words = "where to work; an earlier demo there is replaced"
    add_value(parser, "--folder", "FOLDER", words, Path, Path("hexacell-demo"))
    parser.add_json()


def _run(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "run", "measure, identify, propose, write back and verify")
    parser.add_cell()
    parser.add_resume("run")
    add_flag(parser, "--unattended", "no person can place gauges or approve")
    parser.add_argument(
        "--mode",
        choices=MODES,
        help="check: measure until the error is decided, change nothing (default if unattended); "
        "quick: carry a check on to the accuracy of the last calibration, and write back; "
        "optimise: calibrate and write back (default otherwise)",
    )
    add_flag(
        parser,
        "--length-check",
        "check the length scale before the verdict, with the fixture of [length_check]; a resumed run "
        "has it if it was begun with it",
    )
    add_output(parser, "--events", EVENTS, "write each event there, as a line of JSON, as it happens")
    parser.add_json()


def _tui(commands: Any) -> None:  # noqa: ANN401
    add_command(commands, "tui", "the technician's screen: measure, review, approve, roll back").add_cell()


def _length(commands: Any) -> None:  # noqa: ANN401
    summary = "check the scale of the encoders against a known length"
    parser = add_command(commands, "length", summary, "run.length")
    parser.add_cell()
    parser.add_resume("check")
    add_flag(parser, "--unattended", "no person can mount the gauges")
    parser.add_json()


def _preflight(commands: Any) -> None:  # noqa: ANN401
    summary = "check everything that must hold before motion; moves nothing"
    parser = add_command(commands, "preflight", summary)
    parser.add_cell()
    add_flag(parser, "--unattended", "check also that no person is needed")
    words = "of the run: a calibration (default), or the quick level from the last result on"
    parser.add_argument("--mode", choices=MODES[1:], default="optimise", help=words)
    parser.add_json()


def _simulate(commands: Any) -> None:  # noqa: ANN401
    summary = "serve a simulated cell to other processes until interrupted"
    parser = add_command(commands, "simulate", summary, "serve.simulate")
    parser.add_cell()
    add_output(parser, "--output", SERVED_CELL, "write the cell file for `run` there instead of to stdout")


def _host(commands: Any) -> None:  # noqa: ANN401
    """The process of a run. People never type it, so the help does not list it."""
    parser = commands.add_parser("host")
    parser.set_defaults(target="host.main")
    parser.add_cell()
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--mode", choices=(*MODES, "length"), required=True)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--length-check", action="store_true")


def _next(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "next", "print the pose worth measuring next", "records.propose_next")
    _add_measurements(parser, "the records so far (CSV)")
    words = "how many poses at this point could not be measured; proposes another"
    parser.add_argument("--refused", type=whole_number(0), default=0, metavar="N", help=words)
    parser.add_json()


def _fit(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "fit", "identify the geometry from a measurement file", "records.fit")
    _add_measurements(parser, "the records (CSV)")
    words = "all parameters, or the encoders' zeros alone (default: as the cell file says)"
    parser.add_argument("--identify", choices=("all", "zeros"), help=words)
    parser.add_json()


def _add_measurements(parser: Parser, what: str) -> None:
    parser.add_cell()
    parser.add_argument("--measurements", type=Path, required=True, metavar="FILE", help=what)


def _replay(commands: Any) -> None:  # noqa: ANN401
    summary = "repeat a recorded run's decisions and results, and compare"
    parser = add_command(commands, "replay", summary, "recorded.replay_run")
    parser.add_run("a run folder, or a journal")
    words = "repeat only these, and take everything else as recorded"
    parser.add_argument("--only", choices=("decisions", "results", "identification"), help=words)
    words = "allowed difference of a number, relative above 1 (default: 1e-9)"
    add_value(parser, "--tolerance", "T", words, float)
    words = "replay nothing; copy the run folder there with every password masked, to be given to others"
    add_value(parser, "--export", "FOLDER", words, Path)
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
"""Name, summary, and what is drawn; each is a row of ``hexacell.cli.commands.study``, slow to import."""


def _studies(commands: Any) -> None:  # noqa: ANN401
    parser = add_parser(commands, "study", "repeat what was published of the method, on simulated robots")
    studies = parser.add_subparsers(title="studies", metavar="STUDY", required=True)
    for name, summary, drawn in STUDIES:
        study = add_command(studies, name, summary, target="study.main")
        study.set_defaults(study=name)
        add_value(study, "--draws", "N", drawn, whole_number(1), 20)
        workers = study.add_mutually_exclusive_group()
        words = "at a time (default: one for each processor)"
        add_value(workers, "--processes", "N", words, whole_number(1))
        words = "of a Dask cluster, tcp://HOST:PORT, instead of processes"
        add_value(workers, "--scheduler", "ADDRESS", words)
        words = "keeps each result, so that a study can be interrupted, and gets a picture"
        add_value(study, "--folder", "FOLDER", words, Path, Path("hexacell-study"))
        study.add_json()


RUN_COMMANDS = (_demo, _run, _tui, _length, _preflight, _simulate, _host, _next, _fit, _replay)
STUDY_COMMANDS = (_studies,)
"""What adds them to a parser."""
