"""Arguments of the commands, in the order in which ``hexacell --help`` has them."""

from pathlib import Path
from typing import Any

from hexacell.cli.arguments.parser import (
    LARGEST_NODE_ID,
    MODES,
    Parser,
    add_command,
    add_flag,
    add_output,
    add_parser,
    add_value,
    bounded_seconds,
    whole_number,
)
from hexacell.storage.output_files import EVENTS, METRICS, NEW_CELL, REPORT, SERVED_CELL, VIEW

SHELLS = ("bash", "zsh", "fish")


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
    parser = add_command(commands, "tui", "the technician's screen: measure, review, approve, roll back")
    parser.add_cell()
    parser.add_argument(
        "--serve",
        nargs="?",
        const="127.0.0.1:8000",
        metavar="ADDRESS:PORT",
        help="show it in browsers, at this address of this computer (default: 127.0.0.1:8000), until "
        "interrupted; for other computers a password is needed",
    )


def _page(commands: Any) -> None:  # noqa: ANN401
    """The process of a page of ``tui --serve``. People never type it, so the help does not list it."""
    parser = commands.add_parser("page")
    parser.set_defaults(target="tui.page")
    parser.add_cell()


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


def _devices(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "devices", "find gauges, encoders, a controller; text for a cell file")
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
    add_value(parser, "--diagnose", "NAME", "watch a gauge, or encoders, of --cell")
    add_value(parser, "--cell", "CELL", "the cell file (TOML) of --diagnose", Path)
    add_value(parser, "--seconds", "S", "how long --diagnose watches", bounded_seconds, 10.0)
    parser.add_json()


def _schedule(commands: Any) -> None:  # noqa: ANN401
    summary = "have a cell checked each day, by units of systemd"
    parser = add_command(commands, "schedule", summary, "unattended.schedule")
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


def _status(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "status", "all cells at a glance: verdicts, and what waits for a person")
    parser.add_argument("cells", type=Path, nargs="*", metavar="CELL", help="cell files (TOML)")
    words = "instead of cell files: all cells that share this archive"
    add_value(parser, "--archive", "URL", words)
    add_output(parser, "--metrics", METRICS, "write it as metrics for Prometheus' node exporter too")
    parser.add_json()


def _notify(commands: Any) -> None:  # noqa: ANN401
    summary = "who hears of unattended runs: list, try, send what waits"
    parser = add_command(commands, "notify", summary, "unattended.notify")
    parser.add_cell()
    what = parser.add_mutually_exclusive_group()
    add_flag(what, "--test", "notify everybody of a test now")
    add_flag(what, "--send", "send what earlier runs could not")
    parser.add_json()


def _serve(commands: Any) -> None:  # noqa: ANN401
    summary = "serve the results of a cell by OPC UA until interrupted"
    add_command(commands, "serve", summary, "serve.results").add_cell()


def _cell(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "cell", "validate or show a cell file, or print its schema")
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True, dest="action")
    for name, summary in (
        ("validate", "check it; every mistake with its line"),
        ("schema", "print the JSON Schema of cell files, for editors and other programs"),
        ("show", "print it with defaults filled in, and the origin of each value"),
    ):
        action = add_parser(actions, name, summary)
        if name != "schema":
            action.add_cell()
        action.add_json()


def _completion(commands: Any) -> None:  # noqa: ANN401
    summary = "print a script that lets a shell complete commands and files"
    parser = add_command(commands, "completion", summary)
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"one of {', '.join(SHELLS)}")


def _apply(commands: Any) -> None:  # noqa: ANN401
    summary = "write the proposal of a run into the controller's config"
    parser = add_command(commands, "apply", summary, "config.apply_run")
    parser.add_run()
    _add_reason(parser)
    parser.add_json()


def _rollback(commands: Any) -> None:  # noqa: ANN401
    summary = "undo what was written into the controller's config"
    parser = add_command(commands, "rollback", summary, "config.rollback_config")
    parser.add_cell()
    words = "restore what this run wrote, by its folder or name (default: undo the latest write)"
    add_value(parser, "--to", "RUN", words)
    _add_reason(parser)
    parser.add_json()


def _add_reason(parser: Parser) -> None:
    words = "why, for `history --changes`: one line of text"
    parser.add_argument("--reason", default="", metavar="TEXT", help=words)


def _history(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "history", "list the runs of a cell, compare two, see what drifts")
    parser.usage = (
        "hexacell history [-h] [--compare RUN RUN | --show RUN |\n"
        "                        --keep DAYS [--delete] | --drift | --changes]\n"
        "                        [--archive URL] [--json] [CELL]"
    )  # argparse does not break a group
    words = "the cell file; without it all of --archive"
    parser.add_argument("cell", type=Path, nargs="?", metavar="CELL", help=words)
    what = parser.add_mutually_exclusive_group()
    words = "what changed from one run to another, parameter by parameter"
    what.add_argument("--compare", nargs=2, metavar=("RUN", "RUN"), help=words)
    add_value(what, "--show", "RUN", "what happened in a run, and when")
    words = "which runs that ended before may be deleted; those that wrote the config never may"
    add_value(what, "--keep", "DAYS", words, float)
    add_flag(what, "--drift", "the trend of every parameter over all runs")
    add_flag(what, "--changes", "every write into the controller's config: when, who, what and why")
    add_flag(parser, "--delete", "with --keep: delete those")
    words = "the index over the runs: postgresql://user@host/database (default: as [archive] has it)"
    add_value(parser, "--archive", "URL", words)
    parser.add_json()


def _report(commands: Any) -> None:  # noqa: ANN401
    summary = "write the report of a run: one file to read, print and file"
    parser = add_command(commands, "report", summary, "recorded.report")
    parser.add_run()
    add_output(
        parser,
        "--output",
        REPORT,
        "where to (default: report.html in the run folder); .pdf gives PDF/A, .xml a Digital Calibration "
        "Certificate",
    )
    add_value(parser, "--compare", "RUN", "say also what has changed since this run, a folder", Path)
    parser.add_json()


def _view(commands: Any) -> None:  # noqa: ANN401
    parser = add_command(commands, "view", "show the robot of a cell or a run in space, in the browser")
    words = "the cell file (TOML), or a run folder"
    parser.add_argument("of", type=Path, metavar="CELL|RUN", help=words)
    words = "where to (default: view.html in the run folder, or beside the cell file); .svg gives a picture"
    add_output(parser, "--output", VIEW, words)
    add_flag(parser, "--no-open", "write the file, and open no browser; with --json neither")
    parser.add_json()


COMMANDS = (
    *(_demo, _run, _tui, _page, _length, _preflight, _simulate, _host, _next, _fit, _replay),
    *(_apply, _rollback, _history, _report, _view),
    *(_devices, _schedule, _status, _notify, _serve, _cell, _completion),
    _studies,
)
"""What adds them to a parser."""
