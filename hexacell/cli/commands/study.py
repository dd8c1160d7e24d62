"""``hexacell study``: what was published of the method, repeated on simulated robots."""

from __future__ import annotations

import argparse
from pathlib import Path

from hexacell.application.studies import processes, study_experiment, study_paper
from hexacell.cli.console import Console
from hexacell.cli.progress import task_bar
from hexacell.errors import ExitCode
from hexacell.presentation.experiment_study import experiment_document, experiment_lines, experiment_picture
from hexacell.presentation.paper_figures import study_picture
from hexacell.presentation.paper_study import study_document, study_lines
from hexacell.storage import atomic_files


def paper(options: argparse.Namespace) -> ExitCode:
    """The simulations of the paper; a picture of its figures goes into the folder."""
    console = Console(options.json)
    with task_bar("trials") as told:
        study = study_paper(options.folder, options.draws, processes(options.processes), told)
    for line in study_lines(study):
        console.print(line)
    _draw(options.folder / "paper.svg", study_picture(study), console)
    console.document(study_document(study))
    return ExitCode.DONE


def experiment(options: argparse.Namespace) -> ExitCode:
    """The experiment of the paper, likewise."""
    console = Console(options.json)
    with task_bar("experiments") as told:
        study = study_experiment(options.folder, options.draws, processes(options.processes), told)
    for line in experiment_lines(study):
        console.print(line)
    _draw(options.folder / "experiment.svg", experiment_picture(study), console)
    console.document(experiment_document(study))
    return ExitCode.DONE


def _draw(path: Path, picture: str, console: Console) -> None:
    atomic_files.write_atomically(path, picture.encode())
    console.print(f"\nThe two figures as a picture: {path}")
