"""What a step uses to do its work: the devices under guards, the clock, the operator, the run folder."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from drivers.interfaces import StartupAction
from hexacell.campaign.time_model import speed_limits
from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.clock import CellClock
from hexacell.config.layout import ConfigLayout, CurrentConfig
from hexacell.identification.terms.corrected_joints import commanded_joints
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import Directions, deviation_of, joints_of
from hexacell.motion.arrival import arrival_directions, least_way
from hexacell.motion.durations import line_duration
from hexacell.motion.trajectory import interpolate_line
from hexacell.noise.allowances import ReferenceChange
from hexacell.runs.run_folder import RunFolder
from procedures.calibration.calibration import Calibration
from procedures.calibration.repeatability import since_zero
from procedures.devices.device_set import Devices, Thermometers, gather_errors
from procedures.devices.settling import DeviceSnapshot, read_series, settle, trimmed_mean
from procedures.guards.guards import Guards
from procedures.guards.position_check import PositionReports
from procedures.resources.controller_config import ConfigChanges, Startup
from procedures.run.keys import SetKey, SixNumbers
from procedures.run.questions import Operator
from procedures.run.readings import Reading, ReadingSeries, on_parts
from procedures.run.state import RunState
from procedures.run.trips import Guard, Trip, WatchedSet

ARRIVAL_PIECES = 240
"""Pieces of a line along which joints are followed: of 100 mm, a reversal within one is of 2 um."""


@dataclass(frozen=True, eq=False)
class RunResources:
    """The resources of one run; a replay has others of the same kind.

    ``require_evidence`` raises ``EvidenceLost`` if the journal is no longer what the run wrote. The
    controller refuses at most ``most_refusals`` poses of one set; then a person is to look at its
    limits. The run began at ``began_s`` by the clock.
    """

    cell: Cell
    calibration: Calibration
    devices: Devices
    clock: CellClock
    operator: Operator
    folder: RunFolder
    thermometers: Thermometers = field(default_factory=Thermometers)
    most_refusals: int = 40
    began_s: float = 0.0
    require_evidence: Callable[[], None] = lambda: None  # a replay writes no journal

    @property
    def settings(self) -> CellSettings:
        """What the cell file states."""
        return self.cell.settings

    @cached_property
    def guards(self) -> Guards:
        """What stops the robot; a guard that tripped stays latched as long as this exists."""
        return Guards(self.settings, self.devices, self.clock, self.folder.path, self.current_config)

    @cached_property
    def current_config(self) -> CurrentConfig:
        """The config that the controller is to run."""
        return CurrentConfig(self.cell.config_paths, ConfigLayout.of(self.settings))

    @cached_property
    def startup(self) -> Startup:
        """What makes the controller ready to move."""
        stated = frozenset(StartupAction(word) for word in self.settings.controller.startup)
        return Startup(self.devices.controller, self.guards, self.operator, stated)

    @cached_property
    def config(self) -> ConfigChanges:
        """What changes the controller's config."""
        return ConfigChanges(self.cell, self.startup, self.folder, self.require_evidence)

    async def prepare(self, state: RunState) -> None:
        """Make the controller, whose config nobody edited, ready to move; raises ``HexacellError``."""
        await self.require_unedited_config(state)
        await self.startup.prepare(state)

    async def require_unedited_config(self, state: RunState) -> None:
        """Make sure that nobody edited the config; raises ``FileError``."""
        self.config.require_unedited(state)

    # Where the robot is, and how it moves.

    async def locate(self) -> PositionReports:
        """Where the robot is; raises ``GuardTripped`` if controller and encoders do not agree on that."""
        return await self.guards.locate()

    async def require_departure(self, state: RunState) -> None:
        """Make sure that the robot is where the run left it; nothing moves. Raises ``GuardTripped``.

        While a run is paused or waits for a person, somebody may have moved it with its own controller.
        """
        supervisor = self.guards.supervisor
        supervisor.check()
        if state.target is None or state.position_unknown:
            return
        reported = await self.devices.controller.position()
        if reported is not None and self._is_at(reported.pose, state.target):
            return
        here = (await self.guards.locate()).pose
        if not self._is_at(here, state.target):
            problem = (
                f"the robot is at {here} and not at {Pose(*state.target)}, where it arrived: it was moved"
            )
            action = "Retry: the run then plans its way from where the robot is"
            raise supervisor.latch(Trip(Guard.POSITION, "controller", problem, action))

    async def is_at(self, pose: SixNumbers | None) -> bool:
        """Whether the robot stands where it was commanded to, or is to be; raises ``GuardTripped``."""
        here = await self.guards.locate()
        return pose is not None and self._is_at(here.pose, pose)

    def _is_at(self, here: Pose, target: SixNumbers) -> bool:
        """Whether a reported pose is a commanded one; each may be off by the tolerance of an arrival."""
        here, there = self.guards.position.completed(here), self.guards.position.completed(Pose(*target))
        settings = self.settings.controller
        position = np.abs(here.position - there.position).max()
        angle = np.degrees(np.abs(here.rotation - there.rotation).max())
        is_near = position <= 2.0 * settings.position_tolerance_mm
        return bool(is_near and angle <= 2.0 * settings.angle_tolerance_deg)

    async def move(self, way: Sequence[Pose], watched: WatchedSet, *, at_gauges: bool) -> None:
        """Move from pose to pose under guards, as fast as allowed with or without gauges at the ball."""
        commanding = self.current_config.geometry()
        robot = self.settings.mechanism, commanding.geometry, commanding.branch
        limits = speed_limits(self.settings.speed, at_gauges=at_gauges)
        moves = [(end, line_duration(*robot, start, end, limits)) for start, end in pairwise(way)]

        def commanded() -> Array:
            now, mechanism = self.current_config.geometry(), self.calibration.robot.mechanism
            states = now.geometry, now.branch, now.corrections
            commands, _ = commanded_joints(mechanism, *states, PoseBatch.of([way[-1]]))
            return np.asarray(commands[0])

        await self.guards.move(moves, watched, commanded)

    def arrival_directions(self, state: RunState, way: Sequence[Pose]) -> Directions:
        """From which side each joint arrives at the end of a way, by the controller's straight lines."""
        commanding, mechanism = self.current_config.geometry(), self.settings.mechanism
        poses = [PoseBatch.of([pose]) for pose in way]
        lines = PoseBatch.joined([interpolate_line(*ends, ARRIVAL_PIECES) for ends in pairwise(poses)])
        states = commanding.geometry, commanding.branch, commanding.corrections
        joints, _ = commanded_joints(mechanism, *states, lines)
        least = least_way(mechanism.words.joint_unit, self.calibration.known(state).allowances.stops)
        return arrival_directions(joints, state.directions, least)

    # What the instruments read.

    async def read(self, state: RunState, windows: int = 1) -> Reading:
        """Trimmed mean of settled windows, and the largest range within one; raises ``HexacellError``."""
        timing = self.settings.timing
        settled = [
            await self.guards.during_readings(lambda: settle(self.devices, timing, self.clock))
            for _ in range(windows)
        ]
        gauges = trimmed_mean(np.concatenate([one.gauges for one in settled]))
        joints = trimmed_mean(np.concatenate([one.joints for one in settled]))
        spreads = np.max([np.ptp(one.gauges, axis=0) for one in settled], axis=0)
        at_s = round(self.clock.now() - self.began_s, 3)
        temperatures = await self.thermometers.read()
        return Reading(
            gauges_mm=deviation_of(_on_axes(self.devices, gauges)),
            spread_mm=deviation_of(np.abs(_on_axes(self.devices, spreads))),
            joints=joints_of(joints),
            temperatures=temperatures,
            part_temperatures=on_parts(self.settings.thermometers, temperatures),
            directions=state.directions,
            at_s=at_s,
            **_raw([snapshot for one in settled for snapshot in one.window]),
        )

    async def read_series(self, count: int) -> ReadingSeries:
        """A series of readings of all devices, once they are settled; raises ``HexacellError``."""
        timing = self.settings.timing
        series = await self.guards.during_readings(
            lambda: read_series(self.devices, timing, self.clock, count)
        )
        return ReadingSeries(
            gauges_mm=tuple(deviation_of(_on_axes(self.devices, row)) for row in series.gauges),
            joints=tuple(joints_of(row) for row in series.joints),
            **_raw(series.window),
        )

    def since_reference(self, state: RunState, at: SetKey, reading: Reading) -> ReferenceChange:
        """How a reading at the reference of a set differs from the one with which it was zeroed."""
        return since_zero(self.calibration.known(state).allowances, state.set(at), reading)

    async def check_gauges(self) -> None:
        """Make sure that the gauges are set as they were; raises ``HexacellError``."""
        checks = [mounted.gauge.check() for mounted in self.devices.gauges]
        await gather_errors("gauges are not as they were", checks)


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
        "skews_s": tuple(round(one.skew_s, 6) for one in snapshots),
    }
