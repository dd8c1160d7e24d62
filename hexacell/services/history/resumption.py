"""Which interrupted run is resumed, and whether its folder belongs to the cell that resumes it.

A run folder may come from anywhere. What it names is therefore compared with the cell before anything moves
or is written: the config, the geometry that commanded the records, and the poses that the robot may be sent
to again.
"""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.config import layout
from hexacell.config.change import BEFORE, RECEIPT, ConfigChange, Receipt, kept_paths
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import SAME_FRAMES, Pose, PoseBatch
from hexacell.robot.model import Robot
from hexacell.robot.stated import stated_limits
from hexacell.runs.run_folder import RunFolder, find_run, run_folders, runs_folder
from hexacell.services.history.recorded_cell import started_robot
from hexacell.services.history.run_summary import run_summary
from procedures.journal.journal import RESTORE
from procedures.resources.controller_config import PROVISIONAL_FOLDER
from procedures.run.keys import SixNumbers
from procedures.run.state import RunState
from procedures.steps import events

LATEST = "latest"
"""Stands for the name of the run that was interrupted last."""


def run_to_resume(cell: Cell, named: str) -> RunFolder:
    """A run by its folder or name, or the interrupted one in which something happened last.

    Raises:
        UsageError: there is no such run.
    """
    if named != LATEST:
        return find_run(cell, named)
    found = {run: run_summary(run) for run in run_folders(cell)}
    last_events = {run: one.ended for run, one in found.items() if one.ended and not one.is_over}
    if not last_events:
        problem = "no run of this cell was interrupted"
        raise UsageError(problem, action=f"Name one; the cell's runs are in {runs_folder(cell)}")
    return max(last_events, key=last_events.__getitem__)


def require_own_run(cell: Cell, folder: RunFolder, state: RunState, *, is_resumed: bool = True) -> None:
    """Check a run folder before its run is resumed, or applied; ``state`` is by its journal.

    Raises ``FileError`` if a file in it is a link, names another config, or has a geometry or a pose that
    is not of this robot.
    """
    for path in (folder.path, folder.path / PROVISIONAL_FOLDER):
        _require_no_links(path)
        if (path / RECEIPT).exists():
            _require_own_config(cell, path / RECEIPT, Receipt.of(path).paths)
    assert state.started is not None  # noqa: S101 - a journal without a start is not resumed
    if is_resumed and folder.proposal.exists():  # it names the config of the cell before that was copied
        named = ConfigChange.load(folder.proposal).paths
        if not layout.are_same_files(named, state.started.config_paths):
            _require_own_config(cell, folder.proposal, named)
    _require_own_geometry(cell, folder, state, state.started)
    _require_own_poses(cell, folder, state, state.started)


def _require_no_links(folder: Path) -> None:
    """Refuse links: what is written to one is written elsewhere."""
    entries = sorted(folder.iterdir()) if folder.is_dir() else []
    for path in (folder, *entries) if folder.name == PROVISIONAL_FOLDER else entries:
        if path.is_symlink():
            raise FileError("is a link; a run's files are no links", subject=path, action=RESTORE)


def _require_own_config(cell: Cell, path: Path, named: tuple[Path, ...]) -> None:
    if not layout.are_same_files(named, cell.config_paths):
        raise FileError(
            f"is for another config, {' and '.join(map(str, named))}",
            subject=path,
            action=f"Resume the run of {' and '.join(map(str, cell.config_paths))}, or restore the run "
            "folder from a copy",
        )


def _require_own_geometry(
    cell: Cell, folder: RunFolder, state: RunState, started: events.RunStarted
) -> None:
    """The journal must state the geometry of the config that the run began with."""
    count = len(cell.config_paths)
    kept = (kept_paths(one, BEFORE, count) for one in (folder.path, folder.path / PROVISIONAL_FOLDER))
    contents = {one: layout.read_contents_if_present(one) for one in (cell.config_paths, *kept)}
    sums = {one: layout.fingerprint_of(held) for one, held in contents.items() if held is not None}
    paths = next((one for one, sha256 in sums.items() if sha256 == started.config_sha256), None)
    if paths is None:
        if state.committed or state.provisional or state.rolling_back or state.config_write_pending:
            raise FileError(
                "the config as it was before the run is missing", subject=folder.path, action=RESTORE
            )
        return
    found = layout.controller_geometry(cell, *paths)
    stated = Geometry.of(cell.settings.mechanism.parameters, started.controller)
    if found.branch != started.branch or not np.array_equal(found.geometry.vector, stated.vector):
        raise _differs(folder, f"another geometry than {paths[0]}")
    own = stated_limits(cell.settings, found, SAME_FRAMES).joint_ranges
    if started.joint_ranges != own or started.limits != found.limits:
        raise _differs(
            folder, f"other limits than the cell file, {paths[0]} and [limits] ini, if one is named"
        )


def _differs(folder: RunFolder, what: str) -> FileError:
    problem = f"states {what}, with which the run began"
    return FileError(problem, subject=folder.journal, line=1, action=RESTORE)


def _require_own_poses(cell: Cell, folder: RunFolder, state: RunState, started: events.RunStarted) -> None:
    """Poses that may be commanded again must be ones that the robot may take.

    They were commanded with one of the geometries that the controller had during the run.
    """
    if not (poses := list(dict.fromkeys(_poses_to_come(state)))):
        return
    robot = started_robot(cell.settings, started)
    batch = PoseBatch.of(Pose(*pose) for pose in poses)
    reached = np.zeros(len(poses), dtype=bool)
    for geometry in _commanding(robot, state):
        joints = robot.mechanism.inverse(geometry, robot.branch, batch)
        reached |= robot.limits_with(geometry).allow_joints(joints)
    allowed = reached & robot.limits.allow_commands(robot.frames.poses(batch))
    if not allowed.all():
        pose = ", ".join(f"{number:g}" for number in poses[int(np.flatnonzero(~allowed)[0])])
        raise FileError(
            f"has the pose {pose}, which the robot cannot take", subject=folder.journal, action=RESTORE
        )


def _poses_to_come(state: RunState) -> Iterator[SixNumbers]:
    """References, discarded records and held-out poses."""
    for measured in state.sets.values():
        yield from (sample.pose for sample in measured.samples)
        yield from (pose for _, pose in measured.again)
    found, confirmation = state.identified, state.confirmation
    held_out = () if found is None else (*found.held_out, *found.held_out_after)
    yield from chain(*held_out, *(() if confirmation is None else confirmation.poses))


def _commanding(robot: Robot, state: RunState) -> Iterator[Geometry]:
    """The geometries that the controller had, or will have, in its own frames."""
    parameters = robot.mechanism.parameters
    yield robot.controller
    if state.provisional is not None:
        yield robot.for_controller(Geometry.of(parameters, state.provisional.geometry))
    if state.proposed is not None and state.proposed.written is not None:
        yield Geometry.of(parameters, state.proposed.written)
    if state.identified is not None:
        yield robot.for_controller(state.identified.result.identified(parameters))
