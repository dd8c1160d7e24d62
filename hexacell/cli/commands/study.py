"""``hexacell study``: what was published of the method, repeated on simulated robots."""

import argparse

from hexacell.cli.console import Console
from hexacell.cli.progress import task_bar
from hexacell.errors import ExitCode, UsageError
from hexacell.storage import atomic_files
from hexacell.study.tasks import NewExecutor, processes, run_study
from hexacell.text.studies import STUDIES


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """One of the studies; its picture goes into the folder of its results."""
    shown, new_executor = STUDIES[options.study], _executors(options)
    with task_bar(shown.study.unit) as progress:
        found = run_study(shown.study, options.folder, options.draws, new_executor, progress)
    for line in shown.lines(found):
        console.print(line)
    picture = options.folder / f"{shown.study.name}.svg"
    atomic_files.write_atomically(picture, shown.picture(found).encode())
    console.print(f"\nThe same as a picture: {picture}")
    console.document(shown.document(found))
    return ExitCode.DONE


def _executors(options: argparse.Namespace) -> NewExecutor:
    if options.scheduler is None:
        return processes(options.processes)
    try:
        from hexacell.study.dask_cluster import dask_cluster  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise UsageError("Dask is not installed", action="Install hexacell[dask]") from error
    return dask_cluster(options.scheduler)
