"""Simulated cells: served to other processes, and calibrated as a demo in a folder of its own."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from hexacell.cell.bundled import CONTROLLER, bundled_config
from hexacell.cell.loader import Cell, checked_cell, dump, load_cell
from hexacell.cell.passwords import password_path
from hexacell.errors import FileError, UsageError
from hexacell.runs.cell_lock import cell_lock, lock_path
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.devices.device_setup import device_addresses
from hexacell.services.run.calibration_run import RunRequest
from hexacell.storage.atomic_files import create_folder_durably, os_errors, read_bytes, write_own
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator

MARKER = ".hexacell-demo"
"""Name of the file that marks a folder as a demo's, which the next demo may replace."""

RUN = "demo"
"""Name of the demo's run; the same each time, so that it can be referred to."""


def require_simulation(cell: Cell) -> Cell:
    """Return a cell, once it is certain that it needs no devices; raises ``UsageError``."""
    if cell.settings.simulation is None:
        raise UsageError("there is no [simulation] in it: this is a real cell", subject=cell.path)
    return cell


@contextmanager
def served_cell(cell: Cell) -> Iterator[str]:
    """Serve a simulated cell within this context; gives a cell file that reaches it, as text.

    Raises ``UsageError`` for a real cell, ``HexacellError`` if the simulation cannot start.
    """
    require_simulation(cell)
    with device_addresses(cell, other_processes=True) as settings:
        paths = {"config": str(cell.config_path.resolve())}
        if settings.controller.taught is not None:
            paths["taught"] = str(cell.taught_path.resolve())
        if (passwords := password_path(settings.controller, cell.path.parent)) is not None:
            paths["password_file"] = str(passwords.resolve())
        files = zip(
            settings.controller.further_files, cell.config_paths[1:], cell.taught_paths[1:], strict=True
        )
        further = tuple(
            one.model_copy(
                update={"config": str(config.resolve()), "taught": one.taught and str(taught.resolve())}
            )
            for one, config, taught in files
        )
        controller = settings.controller.model_copy(update=paths | {"further_files": further})
        yield dump(settings.model_copy(update={"controller": controller}))


def simulated_cell(
    name: str = "simulated-hexaglide", folder: Path | str | None = None, *, seed: int | None = None
) -> Cell:
    """A bundled cell with simulated devices, on a fast clock, copied into a folder of its own.

    Args:
        name: as in ``hexacell demo``: ``gough-stewart``, ``linapod``, ``rotary-cranks``, ...
        folder: empty, new, or that of an earlier copy, which is replaced; by default a new temporary one.
        seed: of the noise of its devices; by default as bundled.

    Raises:
        UsageError: there is no such simulated cell.
        FileError: the folder is neither empty nor an earlier copy's.
        CellBusy: a run goes on in it.
    """
    bundled = require_simulation(load_cell(bundled_config(name)))
    path = _copy_cell(bundled.path, Path(folder or tempfile.mkdtemp(prefix="hexacell-")))
    if seed is not None:
        text = bundled.document.replaced({("simulation", "seed"): str(seed)})
        write_own(path, checked_cell(path, text).text.encode())
    return load_cell(path)


def prepare_demo(folder: Path, config_name: str) -> RunRequest:
    """Copy a bundled cell into ``folder`` and request a calibration of it.

    Raises ``UsageError`` if there is no such simulated cell, ``FileError`` if the folder is neither empty
    nor an earlier demo's, ``CellBusy`` if a demo is running in it.
    """
    cell = simulated_cell(config_name, folder)
    run = RunFolder(runs_folder(cell) / RUN)
    return RunRequest(cell, run, Mode.OPTIMISE, UnattendedOperator(), unattended=True)


def _copy_cell(cell_file: Path, folder: Path) -> Path:
    """Replace what an earlier demo left in ``folder`` by a copy of the cell."""
    if folder.is_dir() and any(folder.iterdir()):
        if not (folder / MARKER).is_file() or (folder / MARKER).is_symlink():
            problem = "this folder is not empty, and no earlier demo's"
            raise FileError(problem, subject=folder, action="Choose another folder")
        # The marker is kept so that a removal that fails can be repeated.
        configs = list(folder.glob(f"*{CONTROLLER}"))
        kept = {folder / MARKER, *(folder / lock_path(config).name for config in configs)}
        with ExitStack() as locks:
            for config in configs:
                locks.enter_context(cell_lock(config))
            with os_errors("the earlier demo cannot be removed", folder):
                for item in set(folder.iterdir()) - kept:
                    shutil.rmtree(item) if item.is_dir() and not item.is_symlink() else item.unlink()
    create_folder_durably(folder)
    write_own(folder / MARKER, b"made by hexacell demo, which replaces this folder\n")
    for source in cell_file.parent.glob(f"{cell_file.stem}*.toml"):
        write_own(folder / source.name, read_bytes(source))
    return folder / cell_file.name
