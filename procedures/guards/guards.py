"""Which devices are watched during which kind of step, and against which limits.

Gauges are watched only within a set: after its reference was taken, on moves between its own poses.
On the way to another point the ball leaves the plates, plungers spring to their ends and gauges may
be carried; nothing that they show then means anything, and asking would only void their zero.
The controller is watched wherever it must stay on, which is not while it is being prepared or reads
its config again: there the driver itself verifies every step.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from drivers.interfaces import EncoderSample
from drivers.stop_input.stop_input import SUBJECT as STOP_LINE
from hexacell.cell.model import CellSettings
from hexacell.clock import CellClock
from hexacell.kinematics.rotations import Array
from procedures.devices.device_set import Devices, MountedGauge
from procedures.guards import rules
from procedures.guards.polling import DevicePoller, DevicePollers, LineActivity
from procedures.guards.snapshot import GaugeDeviation, GuardLimits
from procedures.guards.supervision import MotionSupervisor, Supervised
from procedures.run.state import RunState
from procedures.run.steps import Move, ThreeNumbers
from procedures.run.trips import GuardTripped, Trip

Result = TypeVar("Result")

POLL_PAUSE_S = 0.02
"""Between two questions to one device, s on the wall."""

STOP_GRACE_S = 0.5
"""How long a motion may take to end when it was told to, s on the wall; then its driver is told."""

STUCK_GAUGE_SIGMAS = 5.0


class Guards:
    """The guards of one cell."""

    def __init__(self, settings: CellSettings, devices: Devices, clock: CellClock, folder: Path) -> None:
        self._settings = settings
        self._devices = devices
        self.supervisor = MotionSupervisor(devices.controller, clock, folder, settings.guards.free_disk_mb)

    async def prepare(self) -> None:
        """Make the controller ready to move; whoever decides to do so has seen to what is latched.

        Raises:
            GuardTripped: motion is forbidden, an encoder is not to be trusted, or the disk is full.
        """
        self.supervisor.clear()
        await self.supervisor.supervise(
            self._devices.controller.prepare, self._lanes(), self._limits(), STOP_GRACE_S
        )

    async def move(self, step: Move, state: RunState, commanded: Callable[[], Array]) -> None:
        """Send the robot where a step says; ``commanded`` gives the sliders (6,), mm, for its pose.

        Raises:
            GuardTripped: a guard tripped before, on, or at the end of the way.
        """
        plungers = self._plungers(step, state)
        lanes = self._lanes(controller=True, plungers=plungers)
        reached = await self.supervisor.supervise(
            lambda: self._go(step), lanes, self._limits(), STOP_GRACE_S
        )
        limit = self._settings.guards.following_mm
        trip = rules.following_error(
            await asyncio.to_thread(commanded), np.array(reached.positions_mm), limit
        )
        if trip := trip or _frozen(step, state, plungers):
            raise await self.supervisor.stop(trip)

    async def at_standstill(self, action: Supervised[Result]) -> Result:
        """Do something at the robot, which must not move.

        Raises:
            GuardTripped: it did, or may no longer.
        """
        limits = self._limits(rest_mm=self._settings.guards.following_mm)
        return await self.supervisor.supervise(action, self._lanes(controller=True), limits)

    async def during_readings(self, action: Supervised[Result]) -> Result:
        """Take readings; the devices that are read are left to who reads them.

        Raises:
            GuardTripped: the robot may no longer move.
        """
        lanes = self._lanes(controller=True, encoders=False)
        return await self.supervisor.supervise(action, lanes, self._limits())

    async def reload(self) -> None:
        """Make the controller read its config again.

        Raises:
            GuardTripped: motion is forbidden, or an encoder is not to be trusted.
        """
        await self.supervisor.supervise(
            self._devices.controller.reload, self._lanes(), self._limits(), STOP_GRACE_S
        )

    def drift(self, point: str, drift_mm: ThreeNumbers) -> GuardTripped | None:
        """The error to raise where a set's reference drifted too far; it is not latched: nothing moved."""
        trip = rules.reference_drift(point, drift_mm, self._settings.acceptance.drift_mm)
        return None if trip is None else trip.as_error()

    async def _go(self, step: Move) -> EncoderSample:
        await self._devices.controller.move(step.target)
        return await self._devices.encoders.read()

    def _limits(self, rest_mm: float | None = None) -> GuardLimits:
        guards = self._settings.guards
        plate_mm = self._settings.limits.gauge_travel_mm + guards.plate_margin_mm
        return GuardLimits(guards.stale_s, plate_mm, rest_mm)

    def _lanes(
        self,
        *,
        controller: bool = False,
        encoders: bool = True,
        plungers: tuple[WatchedGauge, ...] = (),
    ) -> DevicePollers:
        devices = self._devices
        return DevicePollers(
            gauges=self._gauge_lanes(plungers),
            encoders=DevicePoller("encoders", devices.encoders.read, POLL_PAUSE_S) if encoders else None,
            controller=DevicePoller("controller", devices.controller.status, POLL_PAUSE_S)
            if controller
            else None,
            stop_input=DevicePoller(STOP_LINE, self._forbidden, POLL_PAUSE_S),
        )

    def _gauge_lanes(self, plungers: tuple[WatchedGauge, ...]) -> tuple[DevicePoller[GaugeDeviation], ...]:
        """Gauges behind one multiplexer share a port, and with it a line."""
        ports = {f"gauge {gauge.name}": gauge.port or gauge.name for gauge in self._settings.gauges}
        lines: defaultdict[str, LineActivity] = defaultdict(LineActivity)
        return tuple(
            DevicePoller(plunger.device, plunger.read_deviation, POLL_PAUSE_S, lines[ports[plunger.device]])
            for plunger in plungers
        )

    async def _forbidden(self) -> str:
        return await self._devices.stop_input.active_reason() or ""

    def _plungers(self, step: Move, state: RunState) -> tuple[WatchedGauge, ...]:
        samples = state.set(step.at).samples
        if not samples:
            return ()
        reference = samples[0].reading.gauges_mm
        return tuple(WatchedGauge(mounted, reference[mounted.axis]) for mounted in self._devices.gauges)


class WatchedGauge:
    """A mounted gauge within a set, and all that it showed."""

    def __init__(self, mounted: MountedGauge, reference_mm: float) -> None:
        self.device = f"gauge {mounted.gauge.name}"
        self.axis = mounted.axis
        self.shown: list[str] = []
        self._mounted = mounted
        self._reference_mm = reference_mm

    async def read_deviation(self) -> GaugeDeviation:
        """How far the plunger is from the set's reference now."""
        reading = await self._mounted.gauge.read_once()
        self.shown.append(reading.raw)
        on_axis = self._mounted.sign * reading.value_mm
        return GaugeDeviation(self.axis, on_axis - self._reference_mm)


def _frozen(step: Move, state: RunState, plungers: tuple[WatchedGauge, ...]) -> Trip | None:
    """A gauge that did not follow a ball which, as far as is known, has moved a good way."""
    samples = state.set(step.at).samples
    if step.expected is None or state.standing != (step.at, len(samples)):
        return None
    for plunger in plungers:
        way = step.expected.deviation_mm[plunger.axis] - samples[-1].deviation_mm[plunger.axis]
        surely = max(0.0, abs(way) - STUCK_GAUGE_SIGMAS * step.expected.sigma_mm[plunger.axis])
        if trip := rules.stuck_gauge(plunger.device, tuple(plunger.shown), float(np.copysign(surely, way))):
            return trip
    return None
