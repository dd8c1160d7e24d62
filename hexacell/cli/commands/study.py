"""``hexacell study``: what was published of the method, repeated on simulated robots."""

from __future__ import annotations

import argparse

from hexacell.application.studies import processes, run_study
from hexacell.cli.console import Console
from hexacell.cli.progress import task_bar
from hexacell.errors import ExitCode
from hexacell.presentation.studies import STUDIES
from hexacell.storage import atomic_files


def main(options: argparse.Namespace) -> ExitCode:
    """One of the studies; its picture goes into the folder of its results."""
    console, shown = Console(options.json), STUDIES[options.study]
    with task_bar(shown.study.unit) as told:
        found = run_study(shown.study, options.folder, options.draws, processes(options.processes), told)
    for line in shown.lines(found):
        console.print(line)
    picture = options.folder / f"{shown.study.name}.svg"
    atomic_files.write_atomically(picture, shown.picture(found).encode())
    console.print(f"\nThe same as a picture: {picture}")
    console.document(shown.document(found))
    return ExitCode.DONE
