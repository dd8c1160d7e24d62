"""Devices, operator and clock of a replay: they answer from the journal.

No robot moves, so there is nothing to supervise: the guards of a replay only evaluate numbers.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from drivers.errors import GaugeAtEnd
from drivers.interfaces import ControllerStatus, DeviceIdentity, EncoderSample, GaugeReading
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.model import CellSettings
from hexacell.clock import CellClock
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from procedures.devices.device_set import Devices, MountedGauge, Thermometers
from procedures.engine.step_executor import StepExecutor
from procedures.guards.guards import Guards
from procedures.guards.supervision import Supervised
from procedures.run import events
from procedures.run.questions import Question
from procedures.run.state import RunState
from procedures.run.steps import Move

PROTOCOL = "recorded"


class RecordedOutcome:
    """The recorded outcome of the step being replayed, as the source of all device readings.

    A record keeps the mean and the range of its window of readings, not each reading. Readings with
    the same mean and range are generated: the first two are at the ends of the range. The clock
    advances only as far as the window must be long.

    Attributes:
        samples_read: how many readings of the window have been given out.
    """

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self.outcome: events.Event | None = None
        self.begun_s = 0.0
        self.samples_read = 0

    def load(self, outcome: events.Event) -> None:
        """Set the outcome that the devices must reproduce from now on."""
        self.begun_s = self.now()
        self.outcome = outcome
        self.samples_read = 0

    def now(self) -> float:
        """Time, s: all readings of a window come at the same time, except the first and the last."""
        elapsed = 0.5 * min(self.samples_read, 1)
        if self.samples_read and self.samples_read >= self._length - 1:
            elapsed = 1.0 + 1e-6
        return self.begun_s + elapsed * self._window_s

    @property
    def reading(self) -> events.Reading | None:
        """The recorded reading of the outcome, if it has one."""
        return getattr(self.outcome, "reading", None)

    def required_reading(self) -> events.Reading:
        """The same; raises ``DeviceError`` if all of its samples have been read."""
        if self.reading is None or self.samples_read >= self._length:
            raise DeviceError("the journal has no further reading", subject="the recorded devices")
        return self.reading

    @property
    def _length(self) -> int:
        return len(self.reading.counts) if self.reading is not None else 0


class RecordedClock(CellClock):
    """The time of the recorded outcome; waiting takes none."""

    def __init__(self, recorded: RecordedOutcome) -> None:
        super().__init__()
        self._recorded = recorded

    def now(self) -> float:
        """Time, s."""
        return self._recorded.now()

    async def sleep(self, seconds: float) -> None:
        """Return at once."""

    def wait(self, seconds: float, until: threading.Event | None = None) -> bool:
        """Return at once."""
        del seconds
        return until is not None and until.is_set()


class RecordedGauge:
    """A gauge that gives recorded readings; ``row`` is its index in the cell file."""

    def __init__(self, recorded: RecordedOutcome, row: int, settings: GaugeSettings) -> None:
        self.name = settings.name
        self._recorded = recorded
        self._row = row
        self._axis = settings.mounting

    async def open(self) -> DeviceIdentity:
        """Nothing to connect."""
        return DeviceIdentity(self.name, PROTOCOL, "a gauge in a journal")

    async def read(self) -> GaugeReading:
        """The next reading of the window; raises ``GaugeAtEnd`` where the recorded gauge did."""
        outcome = self._recorded.outcome
        if isinstance(outcome, events.RecordRejected) and outcome.reading is None:
            return self._at_end(outcome.reason)
        reading, sample = self._recorded.required_reading(), self._recorded.samples_read
        index = self._axis.index
        mean, half = reading.gauges_mm[index], reading.spread_mm[index] / 2
        offset = {0: half, 1: -half}.get(sample, 0.0)
        return GaugeReading(self._axis.reading(mean + offset), reading.answers[sample][self._row])

    async def read_once(self) -> GaugeReading:
        """The same as ``read``."""
        return await self.read()

    async def check(self) -> None:
        """Its settings have not changed."""

    async def close(self) -> None:
        """Nothing to release."""

    def _at_end(self, reason: str) -> GaugeReading:
        if self._row == 0:  # one gauge raises it for all
            raise GaugeAtEnd(reason)
        return GaugeReading(0.0, "")


@dataclass(frozen=True, slots=True)
class RecordedEncoders:
    """Encoders that give the recorded counts."""

    recorded: RecordedOutcome

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """Nothing to connect."""
        return (DeviceIdentity("encoders", PROTOCOL, "encoders in a journal"),)

    async def read(self) -> EncoderSample:
        """The next sample of the window."""
        reading = self.recorded.required_reading()
        self.recorded.samples_read += 1
        return EncoderSample(reading.counts[self.recorded.samples_read - 1], reading.joints_mm)

    async def close(self) -> None:
        """Nothing to release."""


@dataclass(frozen=True, slots=True)
class RecordedController:
    """A controller whose moves all arrive; a move that did not arrive has no arrival in the journal."""

    recorded: RecordedOutcome

    async def open(self) -> DeviceIdentity:
        """Nothing to connect."""
        return DeviceIdentity("controller", PROTOCOL, "a controller in a journal")

    async def prepare(self) -> None:
        """Nothing to do."""

    async def move(self, pose: Pose) -> None:
        """Nothing to do."""

    async def pose(self) -> Pose:
        """The pose in the outcome."""
        pose = getattr(self.recorded.outcome, "pose", None)
        if pose is None:
            raise DeviceError("the journal has no pose for this step", subject="controller")
        return Pose(*pose)

    async def status(self) -> ControllerStatus:
        """Enabled."""
        return ControllerStatus(estop=False, enabled=True)

    async def stop(self) -> None:
        """Nothing to do."""

    async def reload(self) -> None:
        """Nothing to do."""

    async def close(self) -> None:
        """Nothing to release."""


@dataclass(frozen=True, slots=True)
class RecordedOperator:
    """An operator who gives the recorded answers."""

    recorded: RecordedOutcome

    async def ask(self, question: Question) -> str | None:
        """Who approved a change, if anybody did; a question about a failure is never asked here."""
        if isinstance(self.recorded.outcome, events.Committed):
            return self.recorded.outcome.approved_by
        return question.default


class RecordedThermometers(Thermometers):
    """Thermometers that give the recorded temperatures."""

    def __init__(self, recorded: RecordedOutcome) -> None:
        super().__init__()
        self._recorded = recorded

    async def read(self) -> tuple[events.Temperature, ...]:
        """The temperatures of the record."""
        return self._recorded.reading.temperatures if self._recorded.reading is not None else ()


def recorded_devices(settings: CellSettings, recorded: RecordedOutcome) -> Devices:
    """The devices of a cell, answering from the journal."""
    gauges = tuple(
        MountedGauge(RecordedGauge(recorded, row, gauge), gauge.mounting)
        for row, gauge in enumerate(settings.gauges)
    )
    return Devices(gauges, RecordedEncoders(recorded), RecordedController(recorded))


Result = TypeVar("Result")


class InactiveGuards(Guards):
    """Guards without supervision; the drift of a reference, which needs no device, is still evaluated."""

    async def prepare(self) -> None:
        """Nothing to do."""

    async def move(self, step: Move, state: RunState, commanded: Callable[[], Array]) -> None:
        """Nothing to do."""
        del step, state, commanded

    async def at_standstill(self, action: Supervised[Result]) -> Result:
        """Run it."""
        return await action()

    async def during_readings(self, action: Supervised[Result]) -> Result:
        """Run it."""
        return await action()

    async def reload(self) -> None:
        """Nothing to do."""


class RecordedStepExecutor(StepExecutor):
    """A step executor with the devices of a journal."""

    @cached_property
    def guards(self) -> Guards:
        """No supervision."""
        return InactiveGuards(self.cell.settings, self.devices, self.clock, self.folder.path)
