"""Settled readings: readings are taken until a whole window of them agrees."""

from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from drivers.errors import GaugeAtEnd, GaugeUnsteady
from drivers.interfaces import EncoderSample, GaugeReading
from hexacell.cell.measuring import TimingSettings
from hexacell.clock import CellClock
from hexacell.errors import DeviceError, HexacellError, consists_only_of, flatten_errors
from hexacell.kinematics.rotations import Array
from procedures.devices.device_set import Devices, gather_errors

Result = TypeVar("Result")

LEAST_WINDOWS = 3
"""So many windows' worth of readings are taken before giving up, however long they take."""


class NeverSettled(DeviceError):
    """The readings did not come to rest in the time allowed."""


FEWEST_TO_TRIM = 3
TRIMMED = 8
"""One reading in so many is left out at each end; at least one, where there are three."""


@dataclass(frozen=True, slots=True)
class DeviceSnapshot:
    """All devices read once, at the same time.

    ``at_s`` is when the last of them had answered, by the cell's clock, ``skew_s`` how much earlier the
    first had.
    """

    at_s: float
    gauges: tuple[GaugeReading, ...]
    encoders: EncoderSample
    skew_s: float


@dataclass(frozen=True, slots=True)
class Settled:
    """A window of readings that agree."""

    window: tuple[DeviceSnapshot, ...]

    @property
    def gauges(self) -> Array:
        """What the gauges showed (n, 3), mm."""
        return np.array([[reading.value_mm for reading in one.gauges] for one in self.window])

    @property
    def joints(self) -> Array:
        """Joint variables (n, 6), in their unit."""
        return np.array([one.encoders.positions for one in self.window])


def trimmed_mean(readings: Array) -> Array:
    """The mean of readings (n, k) without the largest and smallest of each of the k columns.

    A damaged reading that agrees with its neighbour within the noise is not seen, but it is left out.
    The mean of five undamaged readings scatters by 7 % more for it.
    """
    count = len(readings)
    cut = max(1, count // TRIMMED) if count >= FEWEST_TO_TRIM else 0
    return np.asarray(np.sort(readings, axis=0)[cut : count - cut].mean(axis=0))


async def read_all(devices: Devices, clock: CellClock) -> DeviceSnapshot:
    """Read everything once: the gauges and a round of the encoders at the same time."""
    answered_s: list[float] = []

    async def timed(read: Callable[[], Awaitable[Result]]) -> Result:
        value = await read()
        answered_s.append(clock.now())
        return value

    async def read_gauges() -> list[GaugeReading]:
        calls = [timed(partial(devices.read_gauge, one.gauge)) for one in devices.gauges]
        return await gather_errors("gauges cannot be read", calls)

    calls: list[Awaitable[Any]] = [read_gauges(), timed(devices.read_encoders)]
    gauges, encoders = await gather_errors("devices cannot be read", calls)
    last_s = max(answered_s)
    return DeviceSnapshot(last_s, tuple(gauges), encoders, last_s - min(answered_s))


async def settle(devices: Devices, timing: TimingSettings, clock: CellClock) -> Settled:
    """Read until the last window of readings agrees, and give that window.

    A gauge that moves too much to be read counts as not settled. Raises ``NeverSettled`` with what moved.
    """
    window: deque[DeviceSnapshot] = deque()
    begun, looks = clock.now(), 0
    # Readings come a little early or late: for that no further one is waited for.
    least_s = timing.window_s - 0.5 * timing.interval_s
    while True:
        looks += 1
        look_s = clock.now()
        moving = await _look(devices, timing, clock, window)
        is_full = len(window) >= timing.readings and window[-1].at_s - window[0].at_s >= least_s
        if is_full and not moving:
            return Settled(tuple(window))
        # Counted too, because a slow device or a machine under load must not run out of time unread.
        if looks >= LEAST_WINDOWS * timing.readings and clock.now() - begun > timing.give_up_s:
            words = ", ".join(moving) or "the window of readings is longer than that"
            raise NeverSettled(
                f"the readings did not settle within {timing.give_up_s:g} s: {words}",
                action="Look for vibration or a slipping gauge; the limits are in [timing] of the "
                "cell file",
            )
        await clock.sleep_until(look_s + timing.interval_s)


async def read_series(devices: Devices, timing: TimingSettings, clock: CellClock, count: int) -> Settled:
    """``count`` readings one after the other, once the readings are settled; raises ``DeviceError``."""
    await settle(devices, timing, clock)
    series: list[DeviceSnapshot] = []
    look_s = clock.now()
    while len(series) < count:
        await clock.sleep_until(look_s + timing.interval_s)
        look_s = clock.now()
        series.append(await read_all(devices, clock))
    return Settled(tuple(series))


async def _look(
    devices: Devices, timing: TimingSettings, clock: CellClock, window: deque[DeviceSnapshot]
) -> list[str]:
    """Take one more reading into the window; gives what moved meanwhile, in words."""
    try:
        window.append(await read_all(devices, clock))
    except HexacellError as error:
        is_unsteady = any(isinstance(one, GaugeUnsteady) for one in flatten_errors(error))
        if not is_unsteady or not consists_only_of(error, GaugeUnsteady, GaugeAtEnd):
            raise  # otherwise the ball only moves, which may reach an end of the travel too
        window.clear()
        return [f"{one.subject}: {one.problem}" for one in flatten_errors(error)]
    while len(window) > timing.readings and window[-1].at_s - window[1].at_s >= timing.window_s:
        window.popleft()
    settled = Settled(tuple(window))
    moving = [
        f"gauge {m.gauge.name} by {spread:.3f} mm"
        for m, spread in zip(devices.gauges, np.ptp(settled.gauges, axis=0), strict=True)
        if spread > timing.spread_gauge_mm
    ]
    legs, unit = enumerate(np.ptp(settled.joints, axis=0), start=1), settled.window[0].encoders.unit
    return moving + [
        f"encoder {leg} by {spread:.3f} {unit}" for leg, spread in legs if spread > timing.spread_encoder
    ]
