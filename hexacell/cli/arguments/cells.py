"""Arguments of the commands about devices and cells, and of studies, in the order of the help."""

from pathlib import Path

from hexacell.cli.arguments.parser import (
    LARGEST_NODE_ID,
    MODES,
    Commands,
    add_flag,
    add_output,
    add_value,
    bounded_seconds,
    whole_number,
)
from hexacell.storage.output_files import METRICS, NEW_CELL

SHELLS = ("bash", "zsh", "fish")


def _devices(commands: Commands) -> None:
    parser = commands.add("devices", "find gauges, encoders, a controller; text for a cell file")
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
    words = "answers for --write instead of a terminal; a new FILE is written with every question"
    add_value(parser, "--answers", "FILE", words, Path)
    add_value(parser, "--diagnose", "NAME", "watch a gauge, or encoders, of --cell")
    add_value(parser, "--cell", "CELL", "the cell file (TOML) of --diagnose", Path)
    add_value(parser, "--seconds", "S", "how long --diagnose watches", bounded_seconds, 10.0)
    parser.add_json()


def _schedule(commands: Commands) -> None:
    summary = "have a cell checked each day, by units of systemd"
    parser = commands.add("schedule", summary, "unattended.schedule")
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


def _status(commands: Commands) -> None:
    parser = commands.add("status", "all cells at a glance: verdicts, and what waits for a person")
    parser.add_argument("cells", type=Path, nargs="*", metavar="CELL", help="cell files (TOML)")
    words = "instead of cell files: all cells that share this archive"
    add_value(parser, "--archive", "URL", words)
    add_output(parser, "--metrics", METRICS, "write it as metrics for Prometheus' node exporter too")
    parser.add_json()


def _notify(commands: Commands) -> None:
    summary = "who hears of unattended runs: list, try, send what waits"
    parser = commands.add("notify", summary, "unattended.notify")
    parser.add_cell()
    what = parser.add_mutually_exclusive_group()
    add_flag(what, "--test", "notify everybody of a test now")
    add_flag(what, "--send", "send what earlier runs could not")
    parser.add_json()


def _serve(commands: Commands) -> None:
    summary = "serve the results of a cell by OPC UA until interrupted"
    commands.add("serve", summary, "serve.results").add_cell()


def _cell(commands: Commands) -> None:
    parser = commands.add("cell", "validate or show a cell file, or print its schema")
    actions = parser.add_commands("actions", "ACTION")
    for name, summary in (
        ("validate", "check it; every mistake with its line"),
        ("schema", "print the JSON Schema of cell files, for editors and other programs"),
        ("show", "print it with defaults filled in, and the origin of each value"),
    ):
        action = actions.add(name, summary, "cell.main")
        action.set_defaults(action=name)
        if name != "schema":
            action.add_cell()
        action.add_json()


def _completion(commands: Commands) -> None:
    parser = commands.add("completion", "print a script that lets a shell complete commands and files")
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"one of {', '.join(SHELLS)}")


_EACH_CASE = "of orientations and noise, for each case"
STUDIES = (
    ("paper", "figures 4 and 5 and table 2 of Abtahi et al. (2010)", _EACH_CASE),
    ("experiment", "its experiment, figures 8 and 9, by the robot's repeatability", _EACH_CASE),
)
"""Name, summary, and what is drawn; each is a row of ``hexacell.cli.commands.study``, slow to import."""


def _studies(commands: Commands) -> None:
    parser = commands.add("study", "repeat what was published of the method, on simulated robots")
    studies = parser.add_commands("studies", "STUDY")
    for name, summary, drawn in STUDIES:
        study = studies.add(name, summary, "study.main")
        study.set_defaults(study=name)
        add_value(study, "--draws", "N", drawn, whole_number(1), 20)
        words = "at a time (default: one for each processor)"
        add_value(study, "--processes", "N", words, whole_number(1))
        words = "keeps each result, so that a study can be interrupted, and gets a picture"
        add_value(study, "--folder", "FOLDER", words, Path, Path("hexacell-study"))
        study.add_json()


CELLS = (_devices, _schedule, _status, _notify, _serve, _cell, _completion, _studies)
"""What adds them."""
