"""``hexacell study``: what was published of the method, repeated on simulated robots."""

from __future__ import annotations

import argparse

from hexacell.application.studies import processes, study_paper
from hexacell.cli.console import Console
from hexacell.cli.progress import task_bar
from hexacell.errors import ExitCode
from hexacell.presentation.paper_figures import study_picture
from hexacell.presentation.paper_study import study_document, study_lines
from hexacell.storage import atomic_files

PICTURE = "paper.svg"


def paper(options: argparse.Namespace) -> ExitCode:
    """The simulations of the paper; a picture of its figures goes into the folder."""
    console = Console(options.json)
    with task_bar("trials") as told:
        study = study_paper(options.folder, options.draws, processes(options.processes), told)
    for line in study_lines(study):
        console.print(line)
    picture = options.folder / PICTURE
    atomic_files.write_atomically(picture, study_picture(study).encode())
    console.print(f"\nThe two figures as a picture: {picture}")
    console.document(study_document(study))
    return ExitCode.DONE
