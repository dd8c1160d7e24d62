"""``hexacell demo``: the whole job with nothing attached."""

from __future__ import annotations

import argparse
import shutil
from contextlib import ExitStack
from pathlib import Path

from hexacell.application.calibration_run import RunRequest
from hexacell.cell.bundled import CONTROLLER, bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cli.console import Console
from hexacell.cli.run_session import execute_run, finish
from hexacell.errors import ExitCode, FileError, UsageError
from hexacell.runs.run_folder import RunFolder
from hexacell.storage.atomic_files import create_folder_durably, os_error_to_file_error, write_atomically
from hexacell.storage.cell_lock import config_lock, lock_path
from procedures.calibration.workflow import Mode
from procedures.engine.operator import UnattendedOperator

MARK = ".hexacell-demo"


def main(options: argparse.Namespace) -> ExitCode:
    """Copy a cell into a folder of its own and calibrate it there."""
    console = Console(options.json)
    cell = load_cell(_prepare(options.folder, _simulated(bundled_config(options.config))))
    console.say(
        "A simulated Hexaglide: gauges on serial lines, encoders on CAN, TCP controller.\n"
        "The geometry that its controller works with is wrong by millimetres:\n"
        f"  {cell.config_path}"
    )
    order = RunRequest(
        cell, RunFolder(options.folder / "run"), Mode.OPTIMISE, UnattendedOperator(), unattended=True
    )
    ended = execute_run(order, console)
    return finish(order, ended, console)


def _simulated(cell_file: Path) -> Path:
    """The same, once it is certain that the cell needs no devices.

    Raises:
        UsageError: it does.
    """
    if load_cell(cell_file).settings.simulation is None:
        raise UsageError("there is no [simulation] in it: this is a real cell", subject=cell_file)
    return cell_file


def _prepare(folder: Path, cell_file: Path) -> Path:
    """The folder with a fresh copy of the cell in it, and nothing of a former demo.

    Raises:
        FileError: the folder holds something that no demo put there.
        CellBusy: a demo is running in it.
    """
    if folder.is_dir() and any(folder.iterdir()):
        if not (folder / MARK).is_file():
            raise FileError(
                "this folder is not empty, and not a former demo's",
                subject=folder,
                action="Choose another with --folder",
            )
        _clear(folder)
    create_folder_durably(folder)
    write_atomically(folder / MARK, b"made by hexacell demo, which replaces this folder\n")
    for source in cell_file.parent.glob(f"{cell_file.stem}*.toml"):
        write_atomically(folder / source.name, source.read_bytes())
    return folder / cell_file.name


def _clear(folder: Path) -> None:
    """Remove what a former demo left but its mark, so that a clearing that fails can be repeated."""
    configs = list(folder.glob(f"*{CONTROLLER}"))
    kept = {folder / MARK, *(folder / lock_path(config).name for config in configs)}
    with ExitStack() as held:
        for config in configs:
            held.enter_context(config_lock(config))
        try:
            for item in set(folder.iterdir()) - kept:
                shutil.rmtree(item) if item.is_dir() and not item.is_symlink() else item.unlink()
        except OSError as error:
            raise os_error_to_file_error("the former demo cannot be removed", folder, error) from error
