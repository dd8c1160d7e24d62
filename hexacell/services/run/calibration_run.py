"""One calibration run of a cell: lock, connect, check, then run the engine."""

from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from drivers.interfaces import DeviceIdentity
from hexacell import __version__
from hexacell.campaign.pose_list import pose_list_of
from hexacell.cell.loader import Cell
from hexacell.config.layout import ConfigLayout, CurrentConfig, controller_geometry, fingerprint
from hexacell.config.pending_write import held_config
from hexacell.errors import FileError, HexacellError, UsageError, flatten_errors
from hexacell.results.result import AcceptedResult
from hexacell.robot.model import Robot, robot_of
from hexacell.runs.run_folder import RunFolder, runs_folder, unused
from hexacell.services import search_effort
from hexacell.services.design_facts import require_design
from hexacell.services.devices.device_setup import Connected, device_addresses, open_devices
from hexacell.services.history.journal_soundness import require_sound
from hexacell.services.history.recorded_cell import has_same_cell, started_robot, with_changes
from hexacell.services.history.resumption import require_own_run
from hexacell.services.run.accepted_results import last_accepted_result
from hexacell.storage.atomic_files import read_text, remove_stale_temporaries, write_own
from procedures.calibration.calibration import Calibration, Mode
from procedures.devices.device_set import Devices, LiveValues
from procedures.devices.reconnection import require_known
from procedures.engine.commands import CommandQueue, QuestionBroker
from procedures.engine.engine import Engine, Listener
from procedures.guards.position_check import PositionCheck
from procedures.journal.journal import Journal, read_journal
from procedures.resources.controller_config import require_no_provisional
from procedures.run.questions import Operator
from procedures.run.state import fold
from procedures.steps import events
from procedures.workflow.next_step import StepExecutor
from procedures.workflow.preflight import (
    device_failures,
    plan_failures,
    position_failures,
    raise_all,
    start_failures,
)

EngineWatcher = Callable[[Engine, Devices], None]

NEEDS_RESULT = {
    Mode.QUICK: (
        "the quick level carries on from one",
        "Calibrate the robot with `hexacell run CELL --mode optimise`",
    ),
    Mode.LENGTH: (
        "a length check needs a calibrated machine",
        "Calibrate it with `hexacell run CELL --length-check`, which checks the scale as well",
    ),
}
"""Modes that begin with an accepted result: why, and what to do where there is none."""


@dataclass(frozen=True)
class RunRequest:
    """One run of a cell, new or resumed, and the folder that keeps it.

    ``keeps_hours`` is whether the cell's quiet hours, window and longest duration hold for it.
    """

    cell: Cell
    folder: RunFolder
    mode: Mode
    operator: Operator
    unattended: bool = False
    resume: bool = False
    length_check: bool = False
    keeps_hours: bool = False


async def preflight(cell: Cell, mode: Mode, *, unattended: bool) -> tuple[DeviceIdentity, ...]:
    """Check everything that must hold before motion; nothing moves. Gives the devices that answered.

    Raises:
        HexacellError: every failure, in one report.
    """
    calibration = new_calibration(cell, mode)
    with held_config(*cell.config_paths):
        async with _checked_devices(cell, calibration, runs_folder(cell), unattended) as connected:
            raise_all(await _position_failures(cell, connected))
            return connected.identities


async def calibrate(
    request: RunRequest,
    listeners: Sequence[Listener] = (),
    queue: CommandQueue | None = None,
    live: LiveValues | None = None,
    on_engine: EngineWatcher | None = None,
) -> events.Ended:
    """Measure, identify, verify, propose and write back, as far as the mode and the results allow.

    Args:
        request: the run.
        listeners: called with every event.
        queue: commands for the engine (:mod:`procedures.engine.commands`).
        live: gets what the devices show during the run.
        on_engine: called with the engine before it begins, and with the devices that it uses.

    Raises:
        Interruption: a command ended it.
        HexacellError: it could not begin, or a step failed.
    """
    cell, folder = request.cell, request.folder
    with held_config(*cell.config_paths):
        for path in cell.config_paths:
            remove_stale_temporaries(path)
        started = _resumed_start(request) if request.resume else None
        if started is None:
            require_no_provisional(cell)
            calibration = new_calibration(cell, request.mode, length_check=request.length_check)
        else:
            calibration = calibration_of_run(cell, started)
        async with _checked_devices(cell, calibration, folder.path, request.unattended) as connected:
            require_known(connected.identities, started.devices if started else ())
            if started is None:  # a resumed run may have to finish a change of the config first
                raise_all(await _position_failures(cell, connected))
            devices = connected.devices if live is None else replace(connected.devices, live=live)
            watched = replace(connected, devices=devices)
            return await _run(request, calibration, watched, listeners, queue, on_engine)


@asynccontextmanager
async def _checked_devices(
    cell: Cell, calibration: Calibration, folder: Path, unattended: bool
) -> AsyncIterator[Connected]:
    """Connect the devices, or report every failure of plan, devices, stop input and disk at once."""
    failures = await plan_failures(calibration, unattended=unattended)
    if cell.settings.simulation is not None:
        # A simulated robot starts at its first point and cannot be served if that is out of reach.
        raise_all(failures)
    try:
        with device_addresses(cell) as settings:
            async with open_devices(settings, cell.path.parent) as connected:
                failures += await device_failures(connected.devices)
                failures += await start_failures(connected.devices, folder, settings.guards.free_disk_mb)
                raise_all(failures)
                yield replace(connected, identities=with_changes(cell, connected.identities))
    except HexacellError as error:
        if not failures:
            raise
        raise_all([*failures, *(one for one in flatten_errors(error) if one not in failures)])


async def _position_failures(cell: Cell, connected: Connected) -> list[HexacellError]:
    config = CurrentConfig(cell.config_paths, ConfigLayout.of(cell.settings))
    check = PositionCheck(connected.settings, connected.devices, connected.clock, config)
    return await position_failures(check)


async def _run(
    request: RunRequest,
    calibration: Calibration,
    connected: Connected,
    listeners: Sequence[Listener],
    queue: CommandQueue | None,
    on_engine: EngineWatcher | None,
) -> events.Ended:
    cell, folder = replace(request.cell, settings=connected.settings), request.folder
    if not request.resume:
        folder.create(cell)
    broker = QuestionBroker(request.operator)
    recovery = cell.settings.recovery
    policy = recovery.unattended if request.unattended else recovery.attended
    executor = StepExecutor(
        cell, calibration, connected.devices, connected.clock, broker, folder, connected.thermometers
    )
    try:
        with Journal(folder.journal) as journal:
            remove_stale_temporaries(folder.path)
            began_s = connected.clock.now() - journal.lasted_s
            executor = replace(executor, require_evidence=journal.require_read_back, began_s=began_s)
            engine = Engine(executor, journal, listeners, queue=queue, broker=broker, policy=policy)
            if on_engine is not None:
                on_engine(engine, connected.devices)
            if engine.state.started is None:
                engine.record(run_started(cell, calibration, connected.identities))
            engine.reopen_sets()
            return await engine.run()
    finally:
        # The trace only helps to find faults: whether it can be kept does not decide how a run ends.
        with suppress(FileError):
            write_own(unused(folder.wire), connected.trace.text().encode(errors="backslashreplace"))


def run_started(
    cell: Cell, calibration: Calibration, identities: tuple[DeviceIdentity, ...]
) -> events.RunStarted:
    """The first event of a new run."""
    robot = calibration.robot
    return events.RunStarted(
        software=f"hexacell {__version__}",
        cell=cell.settings.name,
        cell_text=cell.text_without_secrets,
        mode=calibration.mode.value,
        config=str(cell.config_path),
        further_configs=tuple(map(str, cell.config_paths[1:])),
        config_sha256=fingerprint(*cell.config_paths),
        controller=robot.controller.document(),
        branch=robot.branch,
        devices=identities,
        pose_list=None if calibration.listed is None else read_text(calibration.listed.path),
        taught=robot.taught.document(),
        accepted=calibration.accepted,
        joint_ranges=robot.limits.joint_ranges,
        limits=controller_geometry(cell).limits,
        corrections=robot.corrections,
        holds=tuple(sorted(robot.holds)),
        length_check=calibration.length_check,
        expired=cell.settings.expired_on(datetime.now(UTC).date()),
    )


def _resumed_start(request: RunRequest) -> events.RunStarted:
    """The first event of the run to resume, if that can be resumed as it is requested."""
    history = read_journal(request.folder.journal)
    state = fold(history)
    if state.started is None:
        raise FileError("the journal is empty", subject=request.folder.journal, action="Begin a new run")
    if state.ended is not None:
        raise UsageError(f"the run {request.folder.path} is over: {state.ended.line}")
    if not has_same_cell(state.started, request.cell):
        problem = f"{request.cell.path} has changed since the run began"
        raise UsageError(problem, action="Undo the change, or begin a new run")
    if state.started.mode != request.mode.value:
        raise UsageError(
            f"the run was begun in the mode {state.started.mode}", action="Resume it in that mode"
        )
    if request.length_check and not state.started.length_check:
        raise UsageError(
            "the run was begun without a length check",
            action="Resume it without --length-check, and check the length with `hexacell length`",
        )
    require_sound(history, request.cell.settings, request.folder.journal)
    require_own_run(request.cell, request.folder, state)
    return state.started


def calibration_of_run(cell: Cell, started: events.RunStarted) -> Calibration:
    """The calibration or check that a run was begun for."""
    robot, mode = started_robot(cell.settings, started), Mode(started.mode)
    return _calibration(cell, robot, mode, started.accepted, length_check=started.length_check)


def new_calibration(cell: Cell, mode: Mode, *, length_check: bool = False) -> Calibration:
    """The calibration or check of a cell as it is now.

    Raises:
        UsageError: a length check has no fixture, or one of its own no calibrated machine.
    """
    if (length_check or mode is Mode.LENGTH) and cell.settings.length_check is None:
        raise UsageError(
            "a length check needs a fixture with two seats, and the cell file has none",
            subject=cell.path,
            action="Add [length_check] with first_seat, distance_mm and uncertainty_mm",
        )
    accepted = None if mode is Mode.OPTIMISE else last_accepted_result(cell)
    if mode in NEEDS_RESULT and accepted is None:
        why, action = NEEDS_RESULT[mode]
        problem = f"no accepted result has this config: {why}"
        raise UsageError(problem, subject=cell.config_path, action=action)
    require_design(cell)
    return _calibration(cell, robot_of(cell), mode, accepted, length_check=length_check)


def _calibration(
    cell: Cell, robot: Robot, mode: Mode, accepted: AcceptedResult | None, *, length_check: bool
) -> Calibration:
    settings, listed, effort = cell.settings, pose_list_of(cell), search_effort.EFFORT
    return Calibration(settings, robot, mode, listed, accepted, length_check=length_check, effort=effort)
