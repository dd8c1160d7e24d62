"""Polling of the supervised devices: their latest answers, from which the rules are evaluated."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from drivers.errors import ControllerFrozen, GaugeAtEnd, WrongAnswer
from drivers.interfaces import ControllerStatus, EncoderSample
from drivers.serial.port import FRAME_GAP_S
from hexacell.clock import CellClock
from hexacell.errors import HexacellError
from procedures.devices.device_set import Devices

T_co = TypeVar("T_co", covariant=True)

POLL_PAUSE_S = 0.02
"""Pause between two polls of one device, s of real time."""

_FRESH_SAMPLES = 2
"""The second new sample after a heartbeat was certainly taken after it."""


@dataclass(slots=True, eq=False)
class LineActivity:
    """Time since the last answer on a communication line, s of real time.

    Devices on one line are read in turn, so an answer of one shows that the line works for all.
    """

    silent_s: float = 0.0


@dataclass(slots=True, eq=False)
class DevicePoller(Generic[T_co]):
    """Polls one device, named as in error messages, and keeps its latest answer.

    Attributes:
        line: the line on which the device answers.
        value: the latest value; None before the first answer.
        first: the first value.
        error: the error of the latest poll, if it gave no value.
        garbled_count: how many answers in a row were garbled.
        answer_count: how many answers were not garbled.
    """

    device: str
    read: Callable[[], Awaitable[T_co]]
    line: LineActivity = field(default_factory=LineActivity)
    value: T_co | None = None
    first: T_co | None = None
    error: HexacellError | None = None
    garbled_count: int = 0
    answer_count: int = 0

    async def run(self, clock: CellClock, on_answer: Callable[[], None]) -> None:
        """Poll until cancelled; ``on_answer`` is called after every answer and every failure."""
        while True:
            await self.poll()
            on_answer()
            await clock.sleep(POLL_PAUSE_S * clock.factor)

    async def poll(self) -> None:
        """Read the device once."""
        try:
            value = await self.read()
        except WrongAnswer as error:
            self.line.silent_s = -FRAME_GAP_S  # for so long the driver wants silence then
            self.error = error
            self.garbled_count += 1
            return
        except HexacellError as error:
            if isinstance(error, GaugeAtEnd):
                self.line.silent_s = 0.0
            self.error = error
        else:
            self.line.silent_s = 0.0
            self.first = value if self.first is None else self.first
            self.value, self.error = value, None
        self.garbled_count = 0
        self.answer_count += 1


@dataclass(eq=False)
class WatchedController:
    """The controller during one action: its status, and since when its heartbeat has stood.

    A controller that works reports something else whenever the joints move. One whose server answers from
    what it knew last is frozen: the encoders show that a joint ``moved`` by so much, in its unit, and its
    heartbeat stands. For ``patience_s``, s of real time, that may lag behind the joints.
    """

    devices: Devices
    clock: CellClock
    moved: float
    patience_s: float
    _heartbeat: str = ""

    def __post_init__(self) -> None:
        self._restart()

    async def status(self) -> ControllerStatus:
        """Its status now; raises ``ControllerFrozen``: its heartbeat stands although a joint moves."""
        sample = self.devices.live.encoders.value  # before the heartbeat, which may only be newer
        status = await self.devices.controller_status()
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
        if moved.max() <= self.moved:
            return
        now = self.clock.now()
        self._moving_since_s = now if self._moving_since_s is None else self._moving_since_s
        if self.clock.real_seconds(now - self._moving_since_s) > self.patience_s:
            raise ControllerFrozen(
                f"is frozen: its server answers, but reports one position although encoder "
                f"{int(moved.argmax()) + 1} shows a move by {moved.max():.1f} {sample.unit}",
                subject="controller",
                action="Restart it, and find out why; then resume",
            )


@dataclass(frozen=True, slots=True)
class GaugeDeviation:
    """The deviation of a gauge from the reference of its set, mm along base axis ``axis`` (0 to 2)."""

    axis: int
    deviation_mm: float


@dataclass(frozen=True, slots=True)
class PolledDevices:
    """The pollers of one action; a device without a poller is not supervised."""

    gauges: tuple[DevicePoller[GaugeDeviation], ...] = ()
    encoders: DevicePoller[EncoderSample] | None = None
    controller: DevicePoller[ControllerStatus] | None = None
    stop_input: DevicePoller[str] | None = None
    """Its value is the reason why motion is forbidden; empty while motion is allowed."""

    def all(self) -> tuple[DevicePoller[object], ...]:
        """Every poller there is."""
        others = (self.encoders, self.controller, self.stop_input)
        return (*self.gauges, *(poller for poller in others if poller is not None))
