"""Executes steps: with the devices, the disk or by computation. Each step gives the event it caused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from drivers.errors import GaugeAtEnd, PoseRefused
from drivers.interfaces import StartupAction
from hexacell.cell.loader import Cell
from hexacell.clock import CellClock
from hexacell.config.layout import CurrentConfig
from hexacell.errors import HexacellError, consists_only_of
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import deviation_of, joints_of
from hexacell.robot.model import config_layout
from hexacell.robot.stated_limits import gauge_travel_of
from hexacell.runs.run_folder import RunFolder
from procedures.calibration.length_steps import seat_of
from procedures.calibration.mounting import require_response, require_room
from procedures.calibration.set_steps import check_reference, in_words
from procedures.calibration.workflow import Calibration
from procedures.devices.device_set import Devices, Thermometers, gather_errors
from procedures.devices.settling import DeviceSnapshot, Settled, read_series, settle, trimmed_mean
from procedures.engine.computations import Computations
from procedures.engine.config_edits import ConfigEdits
from procedures.engine.config_transactions import ConfigTransactions
from procedures.engine.departure import is_at, require_undisturbed
from procedures.engine.move_durations import MoveDurations
from procedures.engine.startup import Startup
from procedures.guards.guards import Guards
from procedures.run import events
from procedures.run.cancellation import in_thread
from procedures.run.questions import Operator, Question, ask_mounting, ask_placement
from procedures.run.state import RunState
from procedures.run.steps import (
    CloseSet,
    Compute,
    Locate,
    Move,
    Phase,
    Pilot,
    Place,
    Probe,
    Repeat,
    Revisit,
    Sample,
    Standstill,
    Step,
    Try,
)
from procedures.run.trips import GuardTripped

SKEW_DECIMALS = 6
MOST_REFUSALS = 40
"""Of poses of one set by the controller; then its limits are to be looked at, by a person."""

RobotStep = Locate | Move | Place | Sample | Revisit | CloseSet | Standstill | Pilot | Repeat | Probe | Try
"""A step for which the robot must be where its config has it."""


@dataclass(frozen=True, eq=False)
class StepExecutor:
    """Executes the steps of one run with its devices, its operator and its folder."""

    cell: Cell
    calibration: Calibration
    devices: Devices
    clock: CellClock
    operator: Operator
    folder: RunFolder
    thermometers: Thermometers = field(default_factory=Thermometers)

    @cached_property
    def guards(self) -> Guards:
        """What stops the robot; a guard that tripped stays latched as long as this exists."""
        return Guards(self.cell.settings, self.devices, self.clock, self.folder.path, self.current_config)

    @cached_property
    def current_config(self) -> CurrentConfig:
        """The config that the controller is to run."""
        return CurrentConfig(self.cell.config_paths, config_layout(self.cell.settings))

    @cached_property
    def durations(self) -> MoveDurations:
        """How long each move takes."""
        return MoveDurations(self.cell.settings, self.current_config)

    @cached_property
    def startup(self) -> Startup:
        """What makes the controller ready to move."""
        stated = frozenset(StartupAction(word) for word in self.cell.settings.controller.startup)
        return Startup(self.devices.controller, self.guards, self.operator, stated)

    @cached_property
    def config(self) -> ConfigTransactions:
        """What changes the controller's config."""
        return ConfigTransactions(
            self.cell, self.calibration, self.startup, self.devices, self.folder, self.operator
        )

    @cached_property
    def computations(self) -> Computations:
        """What is computed."""
        return Computations(self.cell, self.calibration, self.config, self.folder)

    @cached_property
    def edits(self) -> ConfigEdits:
        """Whether somebody edited the config."""
        return ConfigEdits(self.cell.config_paths, self.folder)

    async def prepare(self, state: RunState) -> None:
        """Make the controller, whose config nobody edited, ready to move; raises ``HexacellError``."""
        await self.require_unedited_config(state)
        await self.startup.prepare(state)

    async def require_unedited_config(self, state: RunState) -> None:
        """See :meth:`ConfigEdits.require_none`."""
        self.edits.require_none(state)

    async def perform(self, step: Step, state: RunState) -> events.Event:
        """Do one step; raises ``HexacellError``."""
        if isinstance(step, Compute):
            return await self._compute(step, state)
        await self.require_unedited_config(state)
        return await self._use_robot(step, state)

    async def _use_robot(self, step: RobotStep, state: RunState) -> events.Event:  # noqa: C901, PLR0911
        match step:
            case Locate():
                return await self.locate()
            case Move():
                return await self._move(step, state)
            case Place():
                return await self._place(step)
            case Sample():
                return await self._sample(step, state)
            case Revisit():
                return await self._revisit(step, state)
            case CloseSet():
                return await self._close(step, state)
            case Standstill():
                return await self.read_standstill(step)
            case Pilot():
                return await self._pilot(step, state)
            case Repeat():
                return events.ReferenceRepeated(at=step.at, reading=await self.read())
            case Probe():
                return events.GaugesProbed(at=step.at, moved_mm=step.moved_mm, reading=await self.read())
            case Try():
                return self._try(step, state)

    async def locate(self) -> events.Located:
        """Where the robot is; raises ``GuardTripped`` if controller and encoders do not agree on that."""
        found = await self.guards.locate()
        return events.Located(
            pose=found.pose.as_tuple(),
            joints=None if found.joints is None else joints_of(found.joints),
            encoders=joints_of(found.encoders),
        )

    async def require_departure(self, state: RunState) -> None:
        """See :func:`procedures.engine.departure.require_undisturbed`."""
        settings = self.cell.settings.controller
        await require_undisturbed(state, self.devices.controller, self.guards, settings)

    async def _move(self, step: Move, state: RunState) -> events.Event:
        await self.require_departure(state)
        here = Pose(*state.target) if state.target else Pose(*(await self.locate()).pose)
        duration_s = self.durations.of(here, step, state)
        try:
            await self.guards.move(step, state, duration_s, lambda: self._commanded(step))
        except PoseRefused as refusal:
            return await self._refused(step, state, refusal)
        except GuardTripped as tripped:
            measured = state.set(step.at)
            is_there = not measured.reference_unverified or measured.rejections > 0
            if not step.at.phase.has_new_geometry or not tripped.trip.is_about_the_ball or not is_there:
                raise
            # The new geometry takes the ball off its plate: the second time that is a verdict.
            self.guards.supervisor.clear()
            return events.RecordRejected(at=step.at, orientation=step.orientation, reason=str(tripped))
        return events.Arrived(at=step.at, orientation=step.orientation, pose=step.pose)

    async def _refused(self, step: Move, state: RunState, refusal: PoseRefused) -> events.PoseExcluded:
        """A refusal of the pose is no failure: the robot is where it was, and others may be possible."""
        here = await self.guards.locate()
        refusals = sum(one.at == step.at for one in state.excluded)
        has_stayed = state.target is not None and is_at(
            here.pose, state.target, self.cell.settings.controller
        )
        if refusals >= MOST_REFUSALS or not has_stayed:
            raise refusal
        excluded = events.PoseExcluded(
            at=step.at,
            orientation=step.orientation,
            pose=step.pose,
            reason=refusal.reason,
            axis=refusal.axis,
            is_highest=refusal.is_highest,
        )
        return await in_thread(self.computations.with_replacements, excluded, state)

    def _commanded(self, step: Move) -> Array:
        """The joint variables (6,) of the target by the geometry that the controller has now."""
        commanding, target = self.current_config.geometry(), PoseBatch.of([step.target])
        mechanism = self.calibration.robot.mechanism
        joints: Array = mechanism.inverse(commanding.geometry, commanding.branch, target)[0]
        return joints

    async def _place(self, step: Place) -> events.Event:
        if question := self._placement_question(step):
            await self.guards.at_standstill(lambda: self.operator.ask(question))
        return events.GaugesPlaced(at=step.at)

    def _placement_question(self, step: Place) -> Question | None:
        """What to ask a person; none where no person is needed."""
        settings, pose = self.cell.settings, Pose(*step.pose)
        if step.at.phase is Phase.LENGTH and settings.length_check is not None:
            is_by_hand = settings.length_check.mounting == "by-hand"
            return ask_mounting(step.at.point, seat_of(step.at), pose) if is_by_hand else None
        return ask_placement(step.at, pose) if settings.stations.placement == "by-hand" else None

    async def _sample(self, step: Sample, state: RunState) -> events.Event:
        windows = 1 if state.noise is None else state.noise.noise.windows
        reading = await self._read_inside(step, state, windows)
        if isinstance(reading, events.RecordRejected):
            return reading
        zero = state.zero(step.at) or reading
        return events.RecordTaken(
            at=step.at,
            orientation=step.orientation,
            pose=step.pose,
            reading=reading,
            deviation_mm=deviation_of(np.subtract(reading.gauges_mm, zero.gauges_mm)),
        )

    async def _pilot(self, step: Pilot, state: RunState) -> events.Event:
        reading = await self._read_inside(step, state)
        if isinstance(reading, events.RecordRejected):
            return reading
        return events.PilotTaken(at=step.at, orientation=step.orientation, pose=step.pose, reading=reading)

    async def _read_inside(
        self, step: Sample | Pilot, state: RunState, windows: int = 1
    ) -> events.Reading | events.RecordRejected:
        """Readings with the ball inside the gauges' travel."""
        at = {"at": step.at, "orientation": step.orientation}
        try:
            reading = await self.read(windows)
        except HexacellError as error:
            if not consists_only_of(error, GaugeAtEnd):
                raise
            return events.RecordRejected(**at, reason=str(error))
        zero = state.zero(step.at) or reading
        deviation = np.subtract(reading.gauges_mm, zero.gauges_mm)
        if state.zero(step.at) is None:
            require_room(self.cell.settings, reading.gauges_mm)
        room = gauge_travel_of(self.cell.settings).room(zero.gauges_mm)
        if not room.holds(deviation):
            reason = f"the ball is {in_words(deviation)} mm from its reference, farther than {room}"
            return events.RecordRejected(**at, reason=reason, reading=reading)
        return reading

    def _try(self, step: Try, state: RunState) -> events.GaugesTried:
        measured = state.set(step.at)
        zero = np.array(measured.samples[0].reading.gauges_mm)
        moved = np.array([probe.moved_mm for probe in measured.probes])
        shown = np.array([probe.reading.gauges_mm for probe in measured.probes]) - zero
        x, y, z = (deviation_of(row) for row in require_response(self.cell.settings, moved, shown))
        return events.GaugesTried(at=step.at, response=(x, y, z))

    async def _revisit(self, step: Revisit, state: RunState) -> events.Event:
        try:
            reading = await self.read()
        except HexacellError as error:
            if not consists_only_of(error, GaugeAtEnd):
                raise
            return events.SetInvalidated(at=step.at, reason=str(error))
        await self._check_gauges()
        before, limits = state.set(step.at).samples[0].reading, self.cell.settings.reference_agreement
        return check_reference(step.at, before, reading, *limits)

    async def _check_gauges(self) -> None:
        checks = [mounted.gauge.check() for mounted in self.devices.gauges]
        await gather_errors("gauges are not as they were", checks)

    async def _close(self, step: CloseSet, state: RunState) -> events.Event:
        reading = await self.read()
        zero = state.set(step.at).samples[0].reading
        drift = np.subtract(reading.gauges_mm, zero.gauges_mm)
        await self._check_gauges()
        if drifted := self.guards.drift(str(step.at), deviation_of(drift)):
            raise drifted
        return events.SetClosed(
            at=step.at, drift_mm=deviation_of(drift), reading=reading, reason=step.reason
        )

    async def read(self, windows: int = 1) -> events.Reading:
        """The mean of some settled windows of all devices; raises ``HexacellError``."""
        timing = self.cell.settings.timing
        settled = [
            await self.guards.during_readings(lambda: settle(self.devices, timing, self.clock))
            for _ in range(windows)
        ]
        return _reading(self.devices, settled, await self.thermometers.read())

    async def read_standstill(self, step: Standstill) -> events.StandstillRead:
        """A series of readings of all devices, once they are settled; raises ``HexacellError``."""
        settings = self.cell.settings
        count = settings.noise.standstill_readings
        series = await self.guards.during_readings(
            lambda: read_series(self.devices, settings.timing, self.clock, count)
        )
        return events.StandstillRead(
            at=step.at,
            gauges_mm=tuple(deviation_of(_on_axes(self.devices, row)) for row in series.gauges),
            joints=tuple(joints_of(row) for row in series.joints),
            **_raw(series.window),
        )

    async def _compute(self, step: Compute, state: RunState) -> events.Event:  # noqa: PLR0911
        match step.kind:
            case "assess noise":
                return await in_thread(self.computations.assess_noise, state)
            case "identify":
                return await in_thread(self.computations.identify, state)
            case "propose":
                return await in_thread(self.computations.propose, state)
            case "judge":
                return await in_thread(self.computations.judge, state)
            case "lend":
                return await self.config.apply_provisional(state)
            case "take back":
                return await self.config.revert_provisional(state)
            case "commit":
                return await self.config.apply_result(state)
            case "accept":
                return await self.config.ask_whether_kept(state)
            case "roll back":
                return await self.config.revert_result(state)


def _reading(
    devices: Devices, settled: Sequence[Settled], temperatures: tuple[events.Temperature, ...]
) -> events.Reading:
    """The trimmed mean of settled windows, with the largest range within one of them."""
    gauges = trimmed_mean(np.concatenate([one.gauges for one in settled]))
    joints = trimmed_mean(np.concatenate([one.joints for one in settled]))
    spreads = np.max([np.ptp(one.gauges, axis=0) for one in settled], axis=0)
    return events.Reading(
        gauges_mm=deviation_of(_on_axes(devices, gauges)),
        spread_mm=deviation_of(np.abs(_on_axes(devices, spreads))),
        joints=joints_of(joints),
        temperatures=temperatures,
        **_raw([snapshot for one in settled for snapshot in one.window]),
    )


def _on_axes(devices: Devices, values: Array) -> Array:
    """Values (3,) of the gauges, in their order, along base x, y, z."""
    on_axes = np.zeros(3)
    for row, mounted in enumerate(devices.gauges):
        on_axes[mounted.axis.index] = mounted.axis.coordinate(values[row])
    return on_axes


def _raw(snapshots: Sequence[DeviceSnapshot]) -> dict[str, Any]:
    """The fields of raw readings."""
    return {
        "answers": tuple(tuple(reading.raw for reading in one.gauges) for one in snapshots),
        "counts": tuple(one.encoders.counts for one in snapshots),
        "skews_s": tuple(round(one.skew_s, SKEW_DECIMALS) for one in snapshots),
    }
