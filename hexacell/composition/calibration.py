"""One calibration, from a cell file to its end: lock, connect, check, then let the engine run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from hexacell import __version__
from hexacell.archive import RunFolder
from hexacell.cell.base import GeometryValues
from hexacell.cell.file import Cell
from hexacell.composition.devices import Connected, connected, served, with_settings
from hexacell.controller_config.format import ControllerGeometry
from hexacell.controller_config.proposal import fingerprint
from hexacell.errors import FileError, HexacellError, UsageError
from hexacell.files import write_atomically
from hexacell.geometry import Geometry
from hexacell.lock import config_lock
from hexacell.robot import Robot, make_robot, robot_of
from procedures import events
from procedures.calibration import Calibration, Mode
from procedures.devices import each
from procedures.engine import Engine, Listener
from procedures.journal import Journal, read_journal
from procedures.operators import Operator
from procedures.performing import Performer
from procedures.preflight import device_failures, plan_failures, raise_all
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
    calibration = Calibration(cell.settings, robot_of(cell), mode)
    with (
        config_lock(cell.config_path),
        _plan_checked(calibration, unattended=unattended) as failures,
        served(cell) as settings,
    ):
        async with connected(settings) as cell_now:
            failures.extend(await device_failures(cell_now.devices))
            return _identities(cell_now)


async def calibrate(order: Order, listeners: Sequence[Listener] = ()) -> events.Ended:
    """Measure, identify, verify, propose, write back: as far as the mode and the results go.

    Raises:
        HexacellError: it could not begin, or a step could not be done.
    """
    cell = order.cell
    with config_lock(cell.config_path):
        started = _started(order) if order.resume else None
        robot = robot_of(cell) if started is None else _robot_of_run(cell, started)
        calibration = Calibration(cell.settings, robot, order.mode)
        with _plan_checked(calibration, unattended=order.unattended) as failures, served(cell) as settings:
            async with connected(settings) as cell_now:
                failures.extend(await device_failures(cell_now.devices))
                raise_all(failures)
                return await _run(order, with_settings(cell, settings), calibration, cell_now, listeners)


async def _run(
    order: Order,
    cell: Cell,
    calibration: Calibration,
    cell_now: Connected,
    listeners: Sequence[Listener],
) -> events.Ended:
    if not order.resume:
        order.folder.create(cell)
    performer = Performer(cell, calibration, cell_now.devices, cell_now.clock, order.operator, order.folder)
    try:
        with Journal(order.folder.journal) as journal:
            engine = Engine(performer, journal, listeners)
            if engine.state.started is None:
                engine.tell(_beginning(cell, calibration, cell_now))
            engine.void_open_sets()
            return await engine.run()
    finally:
        write_atomically(order.folder.new_wire(), cell_now.trace.text().encode())


@contextmanager
def _plan_checked(calibration: Calibration, *, unattended: bool) -> Iterator[list[HexacellError]]:
    """Failures of the plan join those that are found while the context lasts, in one report."""
    failures = list(plan_failures(calibration, unattended=unattended))
    if failures and calibration.settings.simulation is not None:
        # A simulated cell stands at its first point, and cannot be served if that is out of reach.
        raise_all(failures)
    try:
        yield failures
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


def _robot_of_run(cell: Cell, started: events.RunStarted) -> Robot:
    """The robot with the geometry that commanded the run's measurements, whatever is written by now."""
    values = started.controller
    geometry = ControllerGeometry(Geometry(values.S, values.B, values.l), started.branch)
    return make_robot(cell.settings, geometry)
