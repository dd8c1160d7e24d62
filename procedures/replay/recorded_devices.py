"""Devices, an operator and a clock that live by the journal.

A recorded robot does not move, so nothing can happen to it: its guards look away.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from drivers.gauges.errors import GaugeAtEnd
from drivers.interfaces import ControllerStatus, DeviceIdentity, EncoderSample, GaugeReading
from hexacell.cell.model import CellSettings
from hexacell.clock import CellClock
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from procedures.devices.device_set import Devices, MountedGauge
from procedures.devices.temperatures import Thermometers
from procedures.engine.step_executor import StepExecutor
from procedures.guards.guards import Guards
from procedures.guards.supervision import Supervised
from procedures.run import events
from procedures.run.questions import Question
from procedures.run.state import RunState
from procedures.run.steps import Move

PROTOCOL = "recorded"


class RecordedOutcome:
    """What came of the step that is being replayed, and how far it was read.

    A record keeps the mean and the range of its window, not each reading in it: readings are made up
    that have both, the first two at the ends of the range. Time stands still but for what makes the
    window as long as it must be.
    """

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self.outcome: events.Event | None = None
        self.begun_s = 0.0
        self.samples_read = 0

    def load(self, outcome: events.Event) -> None:
        """The outcome that the devices are to bring about from now on."""
        self.begun_s = self.now()
        self.outcome = outcome
        self.samples_read = 0

    def now(self) -> float:
        """Seconds: all readings of a window at once, but for the first and the last."""
        passed = 0.5 * min(self.samples_read, 1)
        if self.samples_read and self.samples_read >= self._length - 1:
            passed = 1.0 + 1e-6
        return self.begun_s + passed * self._window_s

    @property
    def reading(self) -> events.Reading | None:
        """The settled window behind the outcome, where there was one."""
        return getattr(self.outcome, "reading", None)

    def required_reading(self) -> events.Reading:
        """The same; raises ``DeviceError`` when more is asked for than there is."""
        if self.reading is None or self.samples_read >= self._length:
            raise DeviceError("the journal has no further reading", subject="the recorded devices")
        return self.reading

    @property
    def _length(self) -> int:
        return len(self.reading.counts) if self.reading is not None else 0


class RecordedClock(CellClock):
    """The tape's time; waiting takes none."""

    def __init__(self, tape: RecordedOutcome) -> None:
        super().__init__()
        self._tape = tape

    def now(self) -> float:
        """Seconds on the tape."""
        return self._tape.now()

    async def sleep(self, seconds: float) -> None:
        """Nothing to wait for."""

    def wait(self, seconds: float, until: threading.Event | None = None) -> bool:
        """Nothing to wait for."""
        del seconds
        return until is not None and until.is_set()


class RecordedGauge:
    """A gauge that shows what one showed; ``row`` is its place in the cell file."""

    def __init__(self, tape: RecordedOutcome, row: int, mount: tuple[str, int, int]) -> None:
        self._tape = tape
        self._row = row
        self.name, self._axis, self._sign = mount

    async def open(self) -> DeviceIdentity:
        """Nothing to connect to."""
        return DeviceIdentity(self.name, PROTOCOL, "a gauge in a journal")

    async def read(self) -> GaugeReading:
        """The next reading of the window, or that the plunger is at its end, if it was."""
        outcome = self._tape.outcome
        if isinstance(outcome, events.RecordRejected) and outcome.reading is None:
            return self._at_end(outcome.reason)
        reading, look = self._tape.required_reading(), self._tape.samples_read
        mean, half = reading.gauges_mm[self._axis], reading.spread_mm[self._axis] / 2
        offset = {0: half, 1: -half}.get(look, 0.0)
        return GaugeReading(self._sign * (mean + offset), reading.answers[look][self._row])

    async def read_once(self) -> GaugeReading:
        """The same as a reading."""
        return await self.read()

    async def check(self) -> None:
        """Its zero is as good as it was."""

    async def close(self) -> None:
        """Nothing to let go."""

    def _at_end(self, reason: str) -> GaugeReading:
        if self._row == 0:  # one of them says it for all
            raise GaugeAtEnd(reason)
        return GaugeReading(0.0, "")


@dataclass(frozen=True, slots=True)
class RecordedEncoders:
    """Encoders that count what they counted."""

    tape: RecordedOutcome

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """Nothing to connect to."""
        return (DeviceIdentity("encoders", PROTOCOL, "encoders in a journal"),)

    async def read(self) -> EncoderSample:
        """The next round of the window."""
        reading = self.tape.required_reading()
        self.tape.samples_read += 1
        return EncoderSample(reading.counts[self.tape.samples_read - 1], reading.joints_mm)

    async def close(self) -> None:
        """Nothing to let go."""


@dataclass(frozen=True, slots=True)
class RecordedController:
    """A controller whose moves all arrive: those that did not are no arrivals in the journal."""

    tape: RecordedOutcome

    async def open(self) -> DeviceIdentity:
        """Nothing to connect to."""
        return DeviceIdentity("controller", PROTOCOL, "a controller in a journal")

    async def prepare(self) -> None:
        """It is ready."""

    async def move(self, pose: Pose) -> None:
        """It is there."""

    async def pose(self) -> Pose:
        """Where the outcome says the robot is."""
        pose = getattr(self.tape.outcome, "pose", None)
        if pose is None:
            raise DeviceError("the journal does not say where the robot stood", subject="controller")
        return Pose(*pose)

    async def status(self) -> ControllerStatus:
        """It may move."""
        return ControllerStatus(estop=False, enabled=True)

    async def stop(self) -> None:
        """It stands."""

    async def reload(self) -> None:
        """It has read its config."""

    async def close(self) -> None:
        """Nothing to let go."""


@dataclass(frozen=True, slots=True)
class RecordedOperator:
    """A person who answers what somebody answered."""

    tape: RecordedOutcome

    async def ask(self, question: Question) -> str | None:
        """Who approved a change, if anybody did; a question about a failure is never asked here."""
        if isinstance(self.tape.outcome, events.Committed):
            return self.tape.outcome.approved_by
        return question.default


class RecordedThermometers(Thermometers):
    """Thermometers that show what they showed."""

    def __init__(self, tape: RecordedOutcome) -> None:
        super().__init__()
        self._tape = tape

    async def read(self) -> tuple[events.Temperature, ...]:
        """What stands in the record."""
        return self._tape.reading.temperatures if self._tape.reading is not None else ()


def recorded_devices(settings: CellSettings, tape: RecordedOutcome) -> Devices:
    """The devices of a cell as its journal knows them."""
    mounts = [(gauge.name, "xyz".index(gauge.axis), int(gauge.sign)) for gauge in settings.gauges]
    gauges = tuple(
        MountedGauge(RecordedGauge(tape, row, mount), mount[1], mount[2])
        for row, mount in enumerate(mounts)
    )
    return Devices(gauges, RecordedEncoders(tape), RecordedController(tape))


Result = TypeVar("Result")


class InactiveGuards(Guards):
    """Guards that let everything be done; what they judge by numbers alone, drift, they still judge."""

    async def prepare(self) -> None:
        """It is ready."""

    async def move(self, step: Move, state: RunState, commanded: Callable[[], Array]) -> None:
        """It is there."""
        del step, state, commanded

    async def stand(self, action: Supervised[Result]) -> Result:
        """Do it."""
        return await action()

    async def sample(self, action: Supervised[Result]) -> Result:
        """Take them."""
        return await action()

    async def reload(self) -> None:
        """It has read its config."""


class RecordedStepExecutor(StepExecutor):
    """A performer whose devices are those of a journal."""

    @cached_property
    def guards(self) -> Guards:
        """None."""
        return InactiveGuards(self.cell.settings, self.devices, self.clock, self.folder.path)
