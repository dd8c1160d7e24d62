"""The cell of a recorded run: its robot when it began, its noise, its devices beside those now, its times.

A device that is not what it was when the cell was last run was exchanged, set anew, or plugged elsewhere.
That may be on purpose, and a new run takes them as they are. But a preset, a reversed direction or an
exchanged encoder changes what a robot is thought to do, so it is a remark of the device.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace

from drivers.interfaces import DeviceIdentity
from hexacell.campaign.time_model import USUAL, Overheads
from hexacell.cell.loader import Cell, checked_cell, load_cell
from hexacell.cell.model import CellSettings
from hexacell.config.interface import ControllerGeometry
from hexacell.errors import HexacellError
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.robot.model import Robot, make_robot
from hexacell.runs.run_folder import RunFolder, run_folders
from hexacell.services.history.journal_soundness import read_sound
from procedures.journal.journal import LONGEST_LINE, decode
from procedures.journal.time_spent import overheads_of
from procedures.run.state import RunState
from procedures.steps.events import RunStarted

OF_NO_RESULT = {"name", "report", "archive", "notifications", "opcua", "screen", "unattended"}
"""Parts of a cell file on which no result depends, as none does on comments and order: all others count."""

LOOKED_AT = 5
"""So many runs are read for one that tells what moves take."""


def has_same_cell(started: RunStarted, cell: Cell) -> bool:
    """Whether all that the result of a run depends on is in the cell file as it was when it began."""
    recorded, now = started.cell_text, cell.text_without_secrets
    if recorded == now:
        return True
    with suppress(HexacellError):  # this version may refuse what an older one took
        settings = [checked_cell(cell.path, text).settings for text in (recorded, now)]
        before, after = (one.model_dump_json(exclude=OF_NO_RESULT) for one in settings)
        return before == after
    return False


def started_robot(settings: CellSettings, started: RunStarted) -> Robot:
    """The robot by a cell's settings, which may be newer, and its controller when a run began."""
    parameters = settings.mechanism.parameters
    geometry = Geometry.of(parameters, started.controller)
    holds = frozenset(started.holds)
    commanding = ControllerGeometry(geometry, started.branch, started.limits, started.corrections, holds)
    return make_robot(settings, commanding, taught=Geometry.of(parameters, started.taught))


def commanding_geometries(state: RunState, mechanism: Mechanism) -> tuple[CommandingGeometry, ...]:
    """The geometries that commanded a run: its controller's, and a provisional one in the same frames.

    Empty if nothing is known of the run.
    """
    started, parameters = state.started, mechanism.parameters
    if started is None:
        return ()
    own = CommandingGeometry.of(mechanism, Geometry.of(parameters, started.controller))
    if state.provisional is None:
        return (own,)
    return own, CommandingGeometry(Geometry.of(parameters, state.provisional.geometry), own.frames)


def recorded_state(folder: RunFolder, settings: CellSettings) -> RunState:
    """State of a run; empty if its journal cannot be read, or is of another kind of machine."""
    try:
        return read_sound(folder, settings)[1]
    except HexacellError:
        return RunState()


COMPARED = {
    "protocol": "protocol",
    "description": "device",
    "serial_number": "serial number",
    "settings": "settings",
    "port": "port",
}


def with_changes(cell: Cell, found: Iterable[DeviceIdentity]) -> tuple[DeviceIdentity, ...]:
    """Devices as found, each with a remark on what differs from the last run that can be read.

    What the earlier run did not know is no change. The name of a run is its time.
    """
    run, known = _last(cell)
    remarked = []
    for now in found:
        changes = []
        for field, word in COMPARED.items():
            before, after = getattr(known.get(now.name), field, None), getattr(now, field)
            if before and before != after:
                changes.append(f"{word} {after or 'none'}, which was {before}")
        remark = f"since the run {run}: {', '.join(changes)}" if changes else ""
        remarked.append(replace(now, remark="; ".join(filter(None, (now.remark, remark)))))
    return tuple(remarked)


def _last(cell: Cell) -> tuple[str, dict[str, DeviceIdentity]]:
    """The name of the last run whose first event can be read, and the devices with which it began."""
    for run in reversed(run_folders(cell)):
        with suppress(OSError, HexacellError), run.journal.open("rb") as journal:
            entry = decode(journal.readline(LONGEST_LINE), run.journal, 1)
            if entry is not None and isinstance(entry.event, RunStarted) and entry.event.devices:
                return run.name, {one.name: one for one in entry.event.devices}
    return "", {}


def last_overheads(cell: Cell) -> tuple[Overheads, str]:
    """What moves and readings took in the last run that tells it, and its name; what is usual, and ""."""
    for folder in run_folders(cell)[: -LOOKED_AT - 1 : -1]:
        with suppress(OSError, HexacellError):
            settings = load_cell(folder.cell_file).settings
            entries, state = read_sound(folder, settings)
            if state.started is not None:
                robot = started_robot(settings, state.started)
                if (found := overheads_of(entries, settings, robot)) is not None:
                    return found, folder.name
    return USUAL, ""
