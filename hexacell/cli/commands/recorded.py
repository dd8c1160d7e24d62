"""``hexacell replay``, ``report`` and ``view``: a run repeated, as a page to be filed, or seen in space."""

import argparse
import asyncio
import webbrowser
from dataclasses import asdict
from pathlib import Path

from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.history.reported_run import ReportedRun, reported_run
from hexacell.services.history.run_export import export_run
from hexacell.services.robot_view import view_of_cell, view_of_run
from hexacell.services.run.replay_run import replay
from hexacell.storage.output_files import REPORT, VIEW, VIEW_MARK, OutputFile
from hexacell.text import certificate
from hexacell.text.layout import wrapped
from hexacell.text.report.pages import Report, html_of, pdf_of
from hexacell.text.report.report import report_of
from hexacell.text.robot import page_of, robot_picture
from procedures.replay.recorded_executor import TOLERANCE
from procedures.replay.replayer import Aspect, ReplayReport, Scope

CERTIFICATE = ".xml"
"""How the name of a file ends that is to be one."""

KINDS = (".html", ".htm", ".pdf", CERTIFICATE)
KINDS_OF_VIEWS = (".html", ".htm", ".svg")

LISTED_DIFFERENCES = 10
"""How many differences of a replay are printed."""


def replay_run(options: argparse.Namespace, console: Console) -> ExitCode:
    """Replay, and report what differs from the recording; or export the run, and replay nothing."""
    if options.export is not None:
        names = export_run(options.run, options.export)
        console.show(
            {"exported": str(options.export), "files": list(names)},
            f"{options.export}: {len(names)} files of the run, every password masked",
        )
        return ExitCode.DONE
    tolerance = TOLERANCE if options.tolerance is None else options.tolerance
    if not 0.0 <= tolerance < float("inf"):
        raise UsageError(f"--tolerance {tolerance:g} is not a tolerance", action="Give a number from 0")
    replayed = asyncio.run(replay(options.run, Scope(options.only or "all"), tolerance))
    document = {
        "same": replayed.is_same,
        "journal": replayed.journal,
        "events": replayed.events,
        "decisions": replayed.decisions,
        "results": replayed.results,
        "taken": replayed.taken,
        "recorded_by": replayed.recorded_by,
        "replayed_by": replayed.replayed_by,
        "differences": [
            {"line": one.line, "place": one.place, "aspect": one.aspect}
            | {"counts": replayed.counts(one), **asdict(one.change)}
            for one in replayed.differences
        ],
    }
    console.show(document, _replay_report(replayed))
    return ExitCode.DONE if replayed.is_same else ExitCode.OUT_OF_LIMITS


def report(options: argparse.Namespace, console: Console) -> ExitCode:
    """Write the report; the run folder is only read, unless the report goes into it."""
    output = options.output or OutputFile(options.run / "report.html", REPORT)
    target = output.path
    if target.suffix not in KINDS:
        action = "Name one that ends in .html, .pdf or .xml"
        raise UsageError("reports of this kind are not made", subject=target, action=action)
    if options.compare is not None and target.suffix == CERTIFICATE:
        problem = "a certificate compares nothing"
        raise UsageError(problem, action="Leave --compare away, or name a file that ends in .pdf")
    output.require()
    earlier = None if options.compare is None else reported_run(options.compare)
    run = reported_run(options.run)
    made = report_of(run, earlier)
    output.write(_written(target.suffix, run, made))
    document = {"report": target, "identifier": made.identifier, "verdict": made.verdict}
    title = certificate.TITLE if target.suffix == CERTIFICATE else made.title.lower()
    console.show(document, f"{target}: {title}, {made.verdict}")
    return ExitCode.DONE


def view(options: argparse.Namespace, console: Console) -> ExitCode:
    """Write the view of a cell or a run, and open it unless that is not wanted."""
    of: Path = options.of
    default = of / "view.html" if of.is_dir() else of.with_name("view.html")
    output = options.output or OutputFile(default, VIEW)
    target = output.path
    if target.suffix not in KINDS_OF_VIEWS:
        action = "Name one that ends in .html or .svg"
        raise UsageError("views of this kind are not made", subject=target, action=action)
    output.require()
    shown = view_of_run(reported_run(of)) if of.is_dir() else view_of_cell(cell_at(of, console))
    made = robot_picture(shown)[0] if target.suffix == ".svg" else page_of(shown)
    output.write(made.encode() + VIEW_MARK)
    document = {"view": target, "title": shown.title, "poses": len(shown.poses)}
    console.show(document, f"{target}: the robot of {shown.title}")
    if not (options.no_open or options.json or webbrowser.open(target.resolve().as_uri())):
        console.print("There is no browser here: open the file in one")
    return ExitCode.DONE


def _written(suffix: str, run: ReportedRun, made: Report) -> bytes:
    match suffix:
        case ".pdf":
            return pdf_of(made)
        case ".xml":
            return certificate.certificate_of_run(run)
        case _:
            return html_of(made).encode()


def _replay_report(replayed: ReplayReport) -> str:
    """The differences, those that count first, and the verdict."""
    found = sorted(replayed.differences, key=lambda one: not replayed.counts(one))
    lines = [
        wrapped(f"{'NO' if replayed.counts(one) else '--'}  {one}", indent=4)
        for one in found[:LISTED_DIFFERENCES]
    ]
    if len(found) > LISTED_DIFFERENCES:
        lines.append(f"and {len(found) - LISTED_DIFFERENCES} more (--json lists them)")
    if any(one.aspect is Aspect.DECISION for one in found) and not replayed.is_same_software:
        lines.append(
            wrapped(f"{replayed.recorded_by} recorded it: {replayed.replayed_by} may decide otherwise.")
        )
    outcome = "the same as recorded"
    if not replayed.is_same:
        first = next(one for one in replayed.differences if replayed.counts(one))
        outcome = f"different, first in line {first.line} ({first.place})"
    what = f"{replayed.decisions} decisions and {replayed.results} results of {replayed.events} events"
    return "\n".join([*lines, f"{what}: {outcome}"])
