"""Which devices are supervised during which kind of step, and against which limits.

Gauges are supervised only within a set: after its reference was taken, on moves between its poses. On
moves to another point the ball leaves the gauge plates, plungers extend to their ends and gauges may be
carried, so their readings are not used.
The controller is supervised whenever it must stay enabled. That is not the case while it is prepared
or reloads its config: there the driver itself verifies every step.
"""

import asyncio
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from drivers.errors import MotionInterrupted
from drivers.interfaces import EncoderSample
from drivers.stop_input import SUBJECT as STOP_LINE
from hexacell.cell.model import CellSettings
from hexacell.clock import CellClock
from hexacell.config.layout import CurrentConfig
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.robot.stated import gauge_travel_of
from procedures.devices.device_set import Devices, MountedGauge
from procedures.guards import polling
from procedures.guards.position_check import PositionCheck, PositionReports, PositionSource
from procedures.guards.rules.after_a_move import following_error, stuck_gauge
from procedures.guards.rules.base import GuardLimits
from procedures.guards.supervision import MotionSupervisor, Supervised
from procedures.run.keys import ThreeNumbers
from procedures.run.trips import Trip, WatchedSet

Result = TypeVar("Result")

STOP_GRACE_S = 0.5
"""How long a motion may take to end after a stop before it is cancelled, s of real time."""


@dataclass(eq=False)
class Guards:
    """The guards of one cell; joints may stop as far from their commands as ``following``, in their unit.

    An action under guards raises ``GuardTripped`` if one of them trips: before it, during it, or at the
    end of a move.
    """

    settings: CellSettings
    devices: Devices
    clock: CellClock
    folder: Path
    config: CurrentConfig

    def __post_init__(self) -> None:
        guards, controller = self.settings.guards, self.devices.controller
        self.position = PositionCheck(self.settings, self.devices, self.clock, self.config)
        self.supervisor = MotionSupervisor(controller, self.clock, self.folder, guards.free_disk_mb)
        self.following = guards.following

    async def prepare(self, order: Supervised[None]) -> None:
        """Run the order that makes the controller ready to move; releases the latch."""
        self.supervisor.clear()
        await self.while_not_ready(order)

    async def move(
        self, moves: Sequence[tuple[Pose, float]], watched: WatchedSet, commanded: Callable[[], Array]
    ) -> None:
        """Move to poses, in s each; ``commanded`` gives the joint variables (6,) at the last of them."""
        zero_mm = watched.zero_mm
        gauges: tuple[WatchedGauge, ...] = ()
        if zero_mm is not None:
            mounted = self.devices.gauges
            gauges = tuple(WatchedGauge(self.devices, one, zero_mm[one.axis.index]) for one in mounted)
        pollers, limits = self._pollers(controller=True, gauges=gauges), self._limits(zero_mm=zero_mm)

        async def go() -> EncoderSample:
            for target, duration_s in moves:
                await self.devices.controller.move(target, duration_s)
            return await self.devices.read_encoders()

        try:
            reached = await self.supervisor.supervise(go, pollers, limits, STOP_GRACE_S)
        except MotionInterrupted:
            # Where the forward kinematics failed, the robot is not where this error says that it stopped.
            await self.locate()
            raise
        trip = await self._arrival_trip(await asyncio.to_thread(commanded), reached)
        if trip is None and watched.moved_mm is not None:
            shown = ((one.device, tuple(one.displayed), watched.moved_mm[one.axis]) for one in gauges)
            trip = next(filter(None, (stuck_gauge(*one) for one in shown)), None)
        if trip is not None:
            raise await self.supervisor.stop(trip)

    async def locate(self) -> PositionReports:
        """Where the robot is, which controller and encoders agree on; nothing moves."""
        found = await self.position.read(following=self.following)
        if found.reports is None or found.trip is not None:
            assert found.trip is not None  # noqa: S101 - without reports there is a reason
            raise await self.supervisor.stop(found.trip)
        return found.reports

    async def at_standstill(self, action: Supervised[Result]) -> Result:
        """Run an action during which the robot must stay at standstill."""
        limits = self._limits(rest=self.settings.guards.following)
        return await self.supervisor.supervise(action, self._pollers(controller=True), limits)

    async def during_readings(self, action: Supervised[Result]) -> Result:
        """Run an action that reads gauges and encoders, which are therefore not polled."""
        pollers = self._pollers(controller=True, encoders=False)
        return await self.supervisor.supervise(action, pollers, self._limits())

    async def while_not_ready(self, order: Supervised[None]) -> None:
        """Run an order during which the controller is switched off, on, or homed: its driver watches it.

        Encoders that it reads have no position meanwhile.
        """
        pollers = self._pollers(encoders=not self.settings.encoders.are_of_controller)
        await self.supervisor.supervise(order, pollers, self._limits(), STOP_GRACE_S)

    async def _arrival_trip(self, commanded: Array, reached: EncoderSample) -> Trip | None:
        """A joint is not where it was commanded (6,), or the controller is wrong about where it is."""
        words = self.settings.mechanism.words
        following = following_error(commanded, np.array(reached.positions), self.following, words)
        found = await self.position.read(reached, following=self.following)
        return following if following and found.odd is PositionSource.ENCODERS else found.trip or following

    def _limits(self, rest: float | None = None, zero_mm: ThreeNumbers | None = None) -> GuardLimits:
        guards = self.settings.guards
        plate = gauge_travel_of(self.settings).room(zero_mm).widened(guards.plate_margin_mm)
        return GuardLimits(guards.stale_s, plate, self.settings.mechanism.words, rest)

    def _pollers(
        self, *, controller: bool = False, encoders: bool = True, gauges: "tuple[WatchedGauge, ...]" = ()
    ) -> polling.PolledDevices:
        devices, guards = self.devices, self.settings.guards
        watched = polling.WatchedController(devices, self.clock, guards.following, guards.stale_s)
        # Gauges behind one multiplexer share a port and so a line.
        ports = {f"gauge {one.name}": one.port or one.name for one in self.settings.gauges}
        lines: defaultdict[str, polling.LineActivity] = defaultdict(polling.LineActivity)
        return polling.PolledDevices(
            gauges=tuple(
                polling.DevicePoller(one.device, one.read_deviation, lines[ports[one.device]])
                for one in gauges
            ),
            encoders=polling.DevicePoller("encoders", devices.read_encoders) if encoders else None,
            controller=polling.DevicePoller("controller", watched.status) if controller else None,
            stop_input=polling.DevicePoller(STOP_LINE, devices.stop_reason),
        )


class WatchedGauge:
    """A mounted gauge within a set, and every value it displayed since the move began."""

    def __init__(self, devices: Devices, mounted: MountedGauge, reference_mm: float) -> None:
        self.device = f"gauge {mounted.gauge.name}"
        self.axis = mounted.axis.index
        self.displayed: list[str] = []
        self._devices = devices
        self._mounted = mounted
        self._reference_mm = reference_mm

    async def read_deviation(self) -> polling.GaugeDeviation:
        """The present deviation from the zero of the set."""
        reading = await self._devices.read_gauge_once(self._mounted.gauge)
        self.displayed.append(reading.raw)
        deviation_mm = self._mounted.axis.coordinate(reading.value_mm) - self._reference_mm
        return polling.GaugeDeviation(self.axis, deviation_mm)
