"""Whether the controller works, or only its server still answers.

A controller that works reports something else whenever the joints move. One whose server answers from
what it knew last is frozen: the encoders show another position, and its heartbeat stands.
"""

from __future__ import annotations

import numpy as np

from drivers.errors import ControllerFrozen
from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.clock import CellClock
from procedures.devices.device_set import Devices
from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits, fault_trip
from procedures.run.trips import Guard, Trip

_FRESH_SAMPLES = 2
"""The second new sample after a heartbeat was certainly taken after it."""


class WatchedController:
    """The controller during one action: its status, and since when its heartbeat has stood.

    Args:
        devices: the controller, and the encoders whose samples the guards have.
        clock: the cell's.
        moved: by so much a joint has moved, in its unit.
        patience_s: for so long the heartbeat may lag behind the joints, s of real time.
    """

    def __init__(self, devices: Devices, clock: CellClock, moved: float, patience_s: float) -> None:
        self._devices = devices
        self._clock = clock
        self._moved = moved
        self._patience_s = patience_s
        self._heartbeat = ""
        self._restart()

    async def status(self) -> ControllerStatus:
        """Its status now.

        Raises:
            ControllerFrozen: its heartbeat stands although a joint moves.
        """
        sample = self._devices.live.encoders.value  # before the heartbeat, which may only be newer
        status = await self._devices.controller_status()
        if not status.heartbeat or status.heartbeat != self._heartbeat:
            self._heartbeat = status.heartbeat
            self._restart()
        elif sample is not None:
            self._compare(sample)
        return status

    def _restart(self) -> None:
        self._sample: EncoderSample | None = None
        self._new_samples = 0
        self._before: EncoderSample | None = None
        self._moving_since_s: float | None = None

    def _compare(self, sample: EncoderSample) -> None:
        if sample is not self._sample:
            self._sample, self._new_samples = sample, self._new_samples + 1
        if self._before is None:
            self._before = sample if self._new_samples > _FRESH_SAMPLES else None
            return
        moved = np.abs(np.subtract(sample.positions, self._before.positions))
        if moved.max() <= self._moved:
            return
        now = self._clock.now()
        self._moving_since_s = now if self._moving_since_s is None else self._moving_since_s
        if self._clock.real_seconds(now - self._moving_since_s) > self._patience_s:
            raise ControllerFrozen(
                f"is frozen: its server answers, but reports one position although encoder "
                f"{int(moved.argmax()) + 1} shows a move by {moved.max():.1f} {sample.unit}",
                subject="controller",
                action="Restart it, and find out why; then resume",
            )


def controller_frozen(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    """The controller answers, but always the same, although the joints move."""
    report = devices.controller
    is_frozen = report is not None and isinstance(report.error, ControllerFrozen)
    return fault_trip(Guard.STALE, report) if report is not None and is_frozen else None
