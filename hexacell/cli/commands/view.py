"""``hexacell view``: the robot of a cell or a run as a page to turn in the browser, or as a picture."""

import argparse
import webbrowser
from pathlib import Path

from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.history.reported_run import reported_run
from hexacell.services.robot_view import view_of_cell, view_of_run
from hexacell.storage.output_files import VIEW, VIEW_MARK, OutputFile
from hexacell.text.robot_page import page_of
from hexacell.text.robot_picture import robot_picture

KINDS = (".html", ".htm", ".svg")


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Write the file, and open it unless that is not wanted."""
    of: Path = options.of
    default = of / "view.html" if of.is_dir() else of.with_name("view.html")
    output = options.output or OutputFile(default, VIEW)
    target = output.path
    if target.suffix not in KINDS:
        action = "Name one that ends in .html or .svg"
        raise UsageError("views of this kind are not made", subject=target, action=action)
    output.require()
    view = view_of_run(reported_run(of)) if of.is_dir() else view_of_cell(cell_at(of, console))
    made = robot_picture(view)[0] if target.suffix == ".svg" else page_of(view)
    output.write(made.encode() + VIEW_MARK)
    document = {"view": target, "title": view.title, "poses": len(view.poses)}
    console.show(document, f"{target}: the robot of {view.title}")
    if not (options.no_open or options.json or webbrowser.open(target.resolve().as_uri())):
        console.print("There is no browser here: open the file in one")
    return ExitCode.DONE
