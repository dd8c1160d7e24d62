"""``hexacell demo``: the whole job with nothing attached."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from hexacell.archive import RunFolder
from hexacell.bundled import bundled_config
from hexacell.cell.file import load_cell
from hexacell.cli.calibrating import carry_out, finish
from hexacell.cli.console import Console
from hexacell.composition.calibration import Order
from hexacell.errors import ExitCode, FileError
from hexacell.files import make_folder, write_atomically
from procedures.calibration import Mode
from procedures.operators import Nobody

MARK = ".hexacell-demo"


def main(options: argparse.Namespace) -> ExitCode:
    """Copy a cell into a folder of its own and calibrate it there."""
    console = Console(options.json)
    cell = load_cell(_prepare(options.folder, bundled_config(options.config)))
    console.say(
        "A simulated Hexaglide: gauges on serial lines, encoders on CAN, a controller on TCP.\n"
        f"It is driven with the geometry in {cell.config_path}, which is wrong by millimetres."
    )
    order = Order(cell, RunFolder(options.folder / "run"), Mode.OPTIMISE, Nobody(), unattended=True)
    ended = carry_out(order, console)
    return finish(order, ended, console)


def _prepare(folder: Path, cell_file: Path) -> Path:
    """The folder with a fresh copy of the cell in it, and nothing of a former demo.

    Raises:
        FileError: the folder holds something that no demo put there.
    """
    if folder.is_dir() and any(folder.iterdir()):
        if not (folder / MARK).is_file():
            raise FileError(
                "this folder is not empty, and not a former demo's",
                subject=folder,
                action="Choose another with --folder",
            )
        shutil.rmtree(folder)
    make_folder(folder)
    write_atomically(folder / MARK, b"made by hexacell demo, which replaces this folder\n")
    for source in cell_file.parent.glob(f"{cell_file.stem}*.toml"):
        write_atomically(folder / source.name, source.read_bytes())
    return folder / cell_file.name
