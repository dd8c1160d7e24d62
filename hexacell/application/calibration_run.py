"""One calibration, from a cell file to its end: lock, connect, check, then let the engine run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from hexacell import __version__
from hexacell.application.device_setup import Connected, device_addresses, open_devices, with_settings
from hexacell.campaign.pose_list import pose_list_of
from hexacell.cell.fields import GeometryValues
from hexacell.cell.loader import Cell
from hexacell.controller_config.change import fingerprint
from hexacell.controller_config.interface import ControllerGeometry
from hexacell.errors import FileError, HexacellError, UsageError, flatten_errors
from hexacell.kinematics.geometry import Geometry
from hexacell.robot_model import Robot, make_robot, robot_of
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.storage.atomic_files import read_text, remove_stale_temporaries, write_atomically
from hexacell.storage.cell_lock import cell_lock
from procedures.calibration.preflight import device_failures, plan_failures, raise_all, start_failures
from procedures.calibration.workflow import Calibration, Mode
from procedures.devices.reconnection import require_known
from procedures.engine.config_transactions import holds_provisional
from procedures.engine.engine import Engine, Listener
from procedures.engine.operator import Operator, QuestionBroker
from procedures.engine.recovery_policy import RecoveryPolicy
from procedures.engine.step_executor import StepExecutor
from procedures.journal.journal import Journal, read_journal
from procedures.run import events
from procedures.run.commands import CommandQueue
from procedures.run.state import fold


@dataclass(frozen=True)
class RunRequest:
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
    with cell_lock(cell.config_path):
        failures = await _plan_failures(calibration, unattended=unattended)
        with _joined(failures), device_addresses(cell) as settings:
            async with open_devices(settings, cell.path.parent) as cell_now:
                failures.extend(await _begin_failures(cell, cell_now, runs_folder(cell)))
                return _identities(cell_now)


async def calibrate(
    order: RunRequest, listeners: Sequence[Listener] = (), inbox: CommandQueue | None = None
) -> events.Ended:
    """Measure, identify, verify, propose, write back: as far as the mode and the results go.

    What is put into the ``inbox`` (:mod:`procedures.run.commands`) is heeded while the engine runs.

    Raises:
        Interruption: a command ended it.
        HexacellError: it could not begin, or a step could not be done.
    """
    cell = order.cell
    with cell_lock(cell.config_path):
        remove_stale_temporaries(cell.config_path)
        started = _started(order) if order.resume else None
        if started is None:
            _require_own_geometry(cell)
        robot = robot_of(cell) if started is None else robot_of_run(cell, started)
        calibration = Calibration(cell.settings, robot, order.mode, pose_list_of(cell))
        failures = await _plan_failures(calibration, unattended=order.unattended)
        with _joined(failures), device_addresses(cell) as settings:
            async with open_devices(settings, cell.path.parent) as cell_now:
                failures.extend(await _begin_failures(cell, cell_now, order.folder.path))
                raise_all(failures)
                require_known(cell_now.identities, started.devices if started else ())
                return await _run(
                    order, with_settings(cell, settings), calibration, cell_now, listeners, inbox
                )


def is_unverified(folder: RunFolder) -> bool:
    """Whether a run, as far as its journal can be read, left a written geometry without a verdict."""
    try:
        return fold(read_journal(folder.journal)).is_unverified
    except HexacellError:
        return False


def _require_own_geometry(cell: Cell) -> None:
    """Refuse to begin while the controller has what an interrupted run lent it.

    Raises:
        UsageError: names that run.
    """
    folder = runs_folder(cell)
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if holds_provisional(RunFolder(path), cell.config_path):
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
    order: RunRequest,
    cell: Cell,
    calibration: Calibration,
    cell_now: Connected,
    listeners: Sequence[Listener],
    inbox: CommandQueue | None,
) -> events.Ended:
    if not order.resume:
        order.folder.create(cell)
    broker = QuestionBroker(order.operator)
    policy = RecoveryPolicy.of(cell.settings.recovery, attended=not order.unattended)
    performer = StepExecutor(
        cell,
        calibration,
        cell_now.devices,
        cell_now.clock,
        broker,
        order.folder,
        cell_now.thermometers,
    )
    try:
        with Journal(order.folder.journal) as journal:
            remove_stale_temporaries(order.folder.path)
            engine = Engine(performer, journal, listeners, queue=inbox, broker=broker, policy=policy)
            if engine.state.started is None:
                engine.record(_beginning(cell, calibration, cell_now))
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
        raise_all([*failures, *(one for one in flatten_errors(error) if one not in failures)])
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


def _started(order: RunRequest) -> events.RunStarted:
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
