"""One calibration, from a cell file to its end: lock, connect, check, then let the engine run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from hexacell import __version__
from hexacell.archive import RunFolder, runs_folder
from hexacell.cell.base import GeometryValues
from hexacell.cell.file import Cell
from hexacell.composition.devices import Connected, connected, served, with_settings
from hexacell.controller_config.format import ControllerGeometry
from hexacell.controller_config.proposal import fingerprint
from hexacell.errors import FileError, HexacellError, UsageError
from hexacell.files import read_text, remove_leftovers, write_atomically
from hexacell.geometry import Geometry
from hexacell.lock import config_lock
from hexacell.planning.listed import pose_list_of
from hexacell.robot import Robot, make_robot, robot_of
from procedures import events
from procedures.calibration import Calibration, Mode
from procedures.commands import Inbox
from procedures.desk import Desk
from procedures.devices import each
from procedures.engine import Engine, Listener
from procedures.journal import Journal, read_journal
from procedures.lending import holds_lent
from procedures.operators import Operator
from procedures.performing import Performer
from procedures.preflight import device_failures, plan_failures, raise_all, start_failures
from procedures.recovery import Policy
from procedures.reopening import require_known
from procedures.state import fold


@dataclass(frozen=True)
class Order:
    """What is to be done: one run of a cell, new or resumed, in a folder."""

    cell: Cell
    folder: RunFolder
    mode: Mode
    operator: Operator
    unattended: bool = False
    resume: bool = False


async def preflight(cell: Cell, mode: Mode, *, unattended: bool) -> tuple[events.Identity, ...]:
    """Check everything that must hold before motion; nothing moves.

    Raises:
        HexacellError: every failure, in one report.
    """
    calibration = Calibration(cell.settings, robot_of(cell), mode, pose_list_of(cell))
    with config_lock(cell.config_path):
        failures = await _plan_failures(calibration, unattended=unattended)
        with _joined(failures), served(cell) as settings:
            async with connected(settings, cell.path.parent) as cell_now:
                failures.extend(await _begin_failures(cell, cell_now, runs_folder(cell)))
                return _identities(cell_now)


async def calibrate(
    order: Order, listeners: Sequence[Listener] = (), inbox: Inbox | None = None
) -> events.Ended:
    """Measure, identify, verify, propose, write back: as far as the mode and the results go.

    What is put into the ``inbox`` (:mod:`procedures.commands`) is heeded while the engine runs.

    Raises:
        Interruption: a command ended it.
        HexacellError: it could not begin, or a step could not be done.
    """
    cell = order.cell
    with config_lock(cell.config_path):
        remove_leftovers(cell.config_path)
        started = _started(order) if order.resume else None
        if started is None:
            _require_own_geometry(cell)
        robot = robot_of(cell) if started is None else robot_of_run(cell, started)
        calibration = Calibration(cell.settings, robot, order.mode, pose_list_of(cell))
        failures = await _plan_failures(calibration, unattended=order.unattended)
        with _joined(failures), served(cell) as settings:
            async with connected(settings, cell.path.parent) as cell_now:
                failures.extend(await _begin_failures(cell, cell_now, order.folder.path))
                raise_all(failures)
                require_known(cell_now.identities, started.devices if started else ())
                return await _run(
                    order, with_settings(cell, settings), calibration, cell_now, listeners, inbox
                )


def _require_own_geometry(cell: Cell) -> None:
    """Refuse to begin while the controller has what an interrupted run lent it.

    Raises:
        UsageError: names that run.
    """
    folder = runs_folder(cell)
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if holds_lent(RunFolder(path), cell.config_path):
            raise UsageError(
                f"the run {path} was interrupted and left its provisional geometry here",
                subject=cell.config_path,
                action="Resume that run, which takes it back; or copy its lent/config-before over this",
            )


async def _begin_failures(cell: Cell, cell_now: Connected, folder: Path) -> list[HexacellError]:
    """What the connected devices, the stop line and the disk have against a run kept in ``folder``."""
    guards = cell.settings.guards
    return [
        *await device_failures(cell_now.devices),
        *await start_failures(cell_now.devices, folder, guards.free_disk_mb),
    ]


async def _run(
    order: Order,
    cell: Cell,
    calibration: Calibration,
    cell_now: Connected,
    listeners: Sequence[Listener],
    inbox: Inbox | None,
) -> events.Ended:
    if not order.resume:
        order.folder.create(cell)
    desk = Desk(order.operator)
    policy = Policy.of(cell.settings.recovery, attended=not order.unattended)
    performer = Performer(
        cell,
        calibration,
        cell_now.devices,
        cell_now.clock,
        desk,
        order.folder,
        cell_now.thermometers,
    )
    try:
        with Journal(order.folder.journal) as journal:
            remove_leftovers(order.folder.path)
            engine = Engine(performer, journal, listeners, inbox=inbox, desk=desk, policy=policy)
            if engine.state.started is None:
                engine.tell(_beginning(cell, calibration, cell_now))
            engine.reopen_sets()
            return await engine.run()
    finally:
        # A help in the search for faults: whether it can be kept never decides how a run ends.
        with suppress(FileError):
            write_atomically(order.folder.new_wire(), cell_now.trace.text().encode())


async def _plan_failures(calibration: Calibration, *, unattended: bool) -> list[HexacellError]:
    """What is wrong with the plan, for the report that the devices' failures join."""
    failures = await plan_failures(calibration, unattended=unattended)
    if calibration.settings.simulation is not None:
        # A simulated cell stands at its first point, and cannot be served if that is out of reach.
        raise_all(failures)
    return failures


@contextmanager
def _joined(failures: list[HexacellError]) -> Iterator[None]:
    """One report of ``failures`` and of those that are found while the context lasts."""
    try:
        yield
    except HexacellError as error:
        if not failures:
            raise
        raise_all([*failures, *(one for one in each(error) if one not in failures)])
    raise_all(failures)


def _beginning(cell: Cell, calibration: Calibration, cell_now: Connected) -> events.RunStarted:
    robot = calibration.robot
    return events.RunStarted(
        software=f"hexacell {__version__}",
        cell=cell.settings.name,
        cell_text=cell.text,
        mode=calibration.mode.value,
        config=str(cell.config_path),
        config_sha256=fingerprint(cell.config_path),
        controller=GeometryValues.model_validate(
            {
                "S": robot.controller.S.tolist(),
                "B": robot.controller.B.tolist(),
                "l": robot.controller.l.tolist(),
            }
        ),
        branch=robot.branch,
        devices=_identities(cell_now),
        pose_list=None if calibration.listed is None else read_text(calibration.listed.path),
    )


def _identities(cell_now: Connected) -> tuple[events.Identity, ...]:
    return tuple(
        events.Identity(
            name=found.name,
            protocol=found.protocol,
            description=found.description,
            serial_number=found.serial_number,
        )
        for found in cell_now.identities
    )


def _started(order: Order) -> events.RunStarted:
    """The beginning of the run that is to be resumed.

    Raises:
        UsageError: it is over, or the cell file is no longer the one it was begun with.
        FileError: its journal cannot be read.
    """
    state = fold(read_journal(order.folder.journal))
    if state.started is None:
        raise FileError("the journal is empty", subject=order.folder.journal, action="Begin a new run")
    if state.ended is not None:
        raise UsageError(f"the run {order.folder.path} is over: {state.ended.line}")
    if state.started.cell_text != order.cell.text:
        raise UsageError(
            f"{order.cell.path} has changed since the run began",
            action="Undo the change, or begin a new run",
        )
    if state.started.mode != order.mode.value:
        raise UsageError(
            f"the run was begun in the mode {state.started.mode}", action="Resume it in that mode"
        )
    return state.started


def robot_of_run(cell: Cell, started: events.RunStarted) -> Robot:
    """The robot with the geometry that commanded the run's measurements, whatever is written by now."""
    values = started.controller
    geometry = ControllerGeometry(Geometry(values.S, values.B, values.l), started.branch)
    return make_robot(cell.settings, geometry)
