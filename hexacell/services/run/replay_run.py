"""Replay of a recorded run in a temporary folder: without devices, and without any real config."""

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from hexacell.cell.by_mechanism import geometry_settings
from hexacell.cell.loader import Cell, dump, load_cell
from hexacell.cell.measuring import IdentificationSettings
from hexacell.config.change import BEFORE, ConfigChange, kept_paths
from hexacell.config.layout import fingerprint_of, read_contents_if_present
from hexacell.errors import FileError, HexacellError
from hexacell.runs.run_folder import CELL_FILE, RunFolder
from hexacell.services.history.journal_soundness import require_sound
from hexacell.services.run.calibration_run import calibration_of_run
from procedures.journal.journal import RESTORE, Entry, read_entries
from procedures.replay.recorded_executor import TOLERANCE, RecordedStepExecutor
from procedures.replay.replayer import Replayer, ReplayReport, Scope
from procedures.steps.events import RunStarted

CONFIG = "controller-config"
POSES = "poses.csv"


async def replay(run: Path, scope: Scope = Scope.ALL, tolerance: float = TOLERANCE) -> ReplayReport:
    """Put a recorded run, by its folder or journal, through the procedure again and compare.

    ``tolerance`` is the allowed difference of a number, in its unit; relative above 1. Raises
    ``FileError`` if the journal, or the cell file in it, cannot be read.
    """
    is_folder = await asyncio.to_thread(run.is_dir)
    folder = RunFolder(run if is_folder else run.parent)
    journal = folder.journal if is_folder else run
    entries = read_entries(journal)
    started = entries[0].event if entries else None
    if not isinstance(started, RunStarted):
        raise FileError("the journal has no start", subject=journal, action="Copy the whole run folder")
    report = ReplayReport(journal, started.software, len(entries))
    with TemporaryDirectory(prefix="hexacell-replay-") as name:
        executor, started = _set_up(Path(name), folder, started, entries)
        replayer = Replayer(executor, report, scope, tolerance)
        await replayer.replay([replace(entries[0], event=started), *entries[1:]])
        if executor.folder.proposal.exists():
            report.change = ConfigChange.load(executor.folder.proposal)
    return report


def _set_up(
    scratch: Path, folder: RunFolder, started: RunStarted, entries: Sequence[Entry]
) -> tuple[RecordedStepExecutor, RunStarted]:
    """The procedure with recorded devices, and the run's start with the config of the temporary folder."""
    cell = _cell(scratch, started, folder.journal)
    require_sound((entry.event for entry in entries), cell.settings, folder.journal)
    kept = read_contents_if_present(kept_paths(folder.path, BEFORE, len(cell.config_paths)))
    if kept is None and folder.proposal.is_file():
        kept = ConfigChange.load(folder.proposal).before_contents
    contents = kept if kept is not None and fingerprint_of(kept) == started.config_sha256 else None
    # The files of its config are beside the cell file, under names of their own.
    controller = cell.settings.controller
    further = (
        one.model_copy(update={"config": f"{CONFIG}-{number}"})
        for number, one in enumerate(controller.further_files, start=2)
    )
    controller = controller.model_copy(update={"config": CONFIG, "further_files": tuple(further)})
    changed = {"controller": controller, "identification": _identification(cell, started)}
    settings = cell.settings.model_copy(update=changed)
    if contents is None:
        native = {"config_format": "toml", "config_options": {}, "further_files": ()}
        settings = settings.model_copy(update={"controller": controller.model_copy(update=native)})
        parameters = settings.mechanism.parameters
        geometry = dump(geometry_settings(parameters).model_validate(started.controller))
        branch = f"branch = {list(started.branch)}\n" if started.branch else ""
        contents = (f"[geometry]\n{geometry}{branch}".encode(),)
    cell = replace(cell, settings=settings)
    for path, data in zip(cell.config_paths, contents, strict=True):
        path.write_bytes(data)
    run = RunFolder(scratch / "run")
    run.path.mkdir()
    executor = RecordedStepExecutor.of(cell, calibration_of_run(cell, started), run)
    return executor, started.model_copy(update={"config_sha256": fingerprint_of(contents)})


def _cell(scratch: Path, started: RunStarted, journal: Path) -> Cell:
    path = scratch / CELL_FILE
    path.write_text(started.cell_text, encoding="utf-8")
    try:
        return load_cell(path)
    except HexacellError as error:
        problem = f"this version cannot read the cell file in it ({error})"
        raise FileError(problem, subject=journal, action=f"Replay it with {started.software}") from error


def _identification(cell: Cell, started: RunStarted) -> IdentificationSettings:
    """The plan; a list of poses is written to a file in the temporary folder."""
    plan = cell.settings.identification
    if started.pose_list is None and plan.poses is not None:
        problem = f"it names a list of poses, {plan.poses}, and does not have it"
        raise FileError(problem, subject="the journal", action=RESTORE)
    if started.pose_list is None:
        return plan
    (cell.path.parent / POSES).write_text(started.pose_list, encoding="utf-8")
    return plan.model_copy(update={"poses": POSES})
