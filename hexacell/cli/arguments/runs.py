"""Arguments of the commands about the runs of a cell, in the order in which the help has them."""

from pathlib import Path

from hexacell.cli.arguments.parser import (
    MODES,
    Commands,
    Parser,
    add_flag,
    add_output,
    add_value,
    whole_number,
)
from hexacell.storage.output_files import EVENTS, REPORT, SERVED_CELL, VIEW


def _demo(commands: Commands) -> None:
    parser = commands.add("demo", "do the whole job on a simulated cell, nothing attached", "run.demo")
    words = "one of the cells that come with hexacell"
    add_value(parser, "--config", "NAME", words, default="simulated-hexaglide")
    words = "where to work; an earlier demo there is replaced"
    add_value(parser, "--folder", "FOLDER", words, Path, Path("hexacell-demo"))
    parser.add_json()


def _run(commands: Commands) -> None:
    parser = commands.add("run", "measure, identify, propose, write back and verify")
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


def _tui(commands: Commands) -> None:
    parser = commands.add("tui", "the technician's screen: measure, review, approve, roll back")
    parser.add_cell()
    parser.add_argument(
        "--serve",
        nargs="?",
        const="127.0.0.1:8000",
        metavar="ADDRESS:PORT",
        help="show it in browsers, at this address of this computer (default: 127.0.0.1:8000), until "
        "interrupted; for other computers a password is needed",
    )


def _page(commands: Commands) -> None:
    """The process of a page of ``tui --serve``."""
    parser = commands.add_hidden("page", "tui.page")
    parser.add_cell()


def _length(commands: Commands) -> None:
    parser = commands.add("length", "check the scale of the encoders against a known length", "run.length")
    parser.add_cell()
    parser.add_resume("check")
    add_flag(parser, "--unattended", "no person can mount the gauges")
    parser.add_json()


def _preflight(commands: Commands) -> None:
    parser = commands.add("preflight", "check everything that must hold before motion; moves nothing")
    parser.add_cell()
    add_flag(parser, "--unattended", "check also that no person is needed")
    words = "of the run: a calibration (default), or the quick level from the last result on"
    parser.add_argument("--mode", choices=MODES[1:], default="optimise", help=words)
    parser.add_json()


def _simulate(commands: Commands) -> None:
    summary = "serve a simulated cell to other processes until interrupted"
    parser = commands.add("simulate", summary, "serve.simulate")
    parser.add_cell()
    add_output(parser, "--output", SERVED_CELL, "write the cell file for `run` there instead of to stdout")


def _host(commands: Commands) -> None:
    """The process of a run."""
    parser = commands.add_hidden("host", "host.main")
    parser.add_cell()
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--mode", choices=(*MODES, "length"), required=True)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--length-check", action="store_true")


def _next(commands: Commands) -> None:
    parser = commands.add("next", "print the pose worth measuring next", "records.propose_next")
    _add_measurements(parser, "the records so far (CSV)")
    words = "how many poses at this point could not be measured; proposes another"
    parser.add_argument("--refused", type=whole_number(0), default=0, metavar="N", help=words)
    parser.add_json()


def _fit(commands: Commands) -> None:
    parser = commands.add("fit", "identify the geometry from a measurement file", "records.fit")
    _add_measurements(parser, "the records (CSV)")
    words = "all parameters, or the encoders' zeros alone (default: as the cell file says)"
    parser.add_argument("--identify", choices=("all", "zeros"), help=words)
    parser.add_json()


def _add_measurements(parser: Parser, what: str) -> None:
    parser.add_cell()
    parser.add_argument("--measurements", type=Path, required=True, metavar="FILE", help=what)


def _replay(commands: Commands) -> None:
    summary = "repeat a recorded run's decisions and results, and compare"
    parser = commands.add("replay", summary, "recorded.replay_run")
    parser.add_run("a run folder, or a journal")
    words = "repeat only these, and take everything else as recorded"
    parser.add_argument("--only", choices=("decisions", "results", "identification"), help=words)
    words = "allowed difference of a number, relative above 1 (default: 1e-9)"
    add_value(parser, "--tolerance", "T", words, float)
    words = "replay nothing; copy the run folder there with every password masked, to be given to others"
    add_value(parser, "--export", "FOLDER", words, Path)
    parser.add_json()


def _apply(commands: Commands) -> None:
    summary = "write the proposal of a run into the controller's config"
    parser = commands.add("apply", summary, "config.apply_run")
    parser.add_run()
    _add_reason(parser)
    parser.add_json()


def _rollback(commands: Commands) -> None:
    summary = "undo what was written into the controller's config"
    parser = commands.add("rollback", summary, "config.rollback_config")
    parser.add_cell()
    words = "restore what this run wrote, by its folder or name (default: undo the latest write)"
    add_value(parser, "--to", "RUN", words)
    _add_reason(parser)
    parser.add_json()


def _add_reason(parser: Parser) -> None:
    words = "why, for `history --changes`: one line of text"
    parser.add_argument("--reason", default="", metavar="TEXT", help=words)


def _history(commands: Commands) -> None:
    parser = commands.add("history", "list the runs of a cell, compare two, see what drifts")
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


def _report(commands: Commands) -> None:
    summary = "write the report of a run: one file to read, print and file"
    parser = commands.add("report", summary, "recorded.report")
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


def _view(commands: Commands) -> None:
    summary = "show the robot of a cell or a run in space, in the browser"
    parser = commands.add("view", summary, "recorded.view")
    words = "the cell file (TOML), or a run folder"
    parser.add_argument("of", type=Path, metavar="CELL|RUN", help=words)
    words = "where to (default: view.html in the run folder, or beside the cell file); .svg gives a picture"
    add_output(parser, "--output", VIEW, words)
    add_flag(parser, "--no-open", "write the file, and open no browser; with --json neither")
    parser.add_json()


RUNS = (
    *(_demo, _run, _tui, _page, _length, _preflight, _simulate, _host, _next, _fit, _replay),
    *(_apply, _rollback, _history, _report, _view),
)
"""What adds them."""
