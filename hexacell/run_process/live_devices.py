"""What the devices show now, while no run has them."""

import asyncio
import math
from collections import deque
from collections.abc import AsyncGenerator, Awaitable, Callable, Sequence
from contextlib import AsyncExitStack
from statistics import stdev
from typing import Any

from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import WireTrace
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError
from hexacell.run_process.live_snapshot import GaugeSnapshot, LiveSnapshot, Shown
from hexacell.runs.cell_lock import cell_lock
from hexacell.services.devices.device_setup import device_addresses, devices_of
from procedures.devices.device_set import LiveValue, LiveValues, keep_reading, sources
from procedures.run.cancellation import cancel_and_wait

NOISE_READINGS = 10
"""Number of readings at standstill that the noise is computed from, at most; half of them suffice."""

READ_EVERY_S = 0.2
OPEN_EVERY_S = 1.0
"""A device that could not be opened is tried again."""


class LiveFeed:
    """Makes snapshots of the live values; to be asked for one after each change.

    Attributes:
        is_moving: whether the robot moves, so that readings say nothing of the noise.
    """

    def __init__(self, live: LiveValues, gauges: Sequence[GaugeSettings]) -> None:
        self.is_moving = False
        self._live = live
        self._gauges = tuple(gauges)
        self._recent: dict[str, deque[tuple[float, float]]] = {
            gauge.name: deque(maxlen=NOISE_READINGS) for gauge in gauges
        }

    def snapshot(self) -> LiveSnapshot:
        """The latest values of all devices."""
        live, encoders, controller = self._live, self._live.encoders, self._live.controller
        return LiveSnapshot(
            gauges=tuple(map(self._gauge, self._gauges)),
            encoders=Shown(value=encoders.value, age_s=_age(encoders), problem=encoders.problem),
            controller=Shown(value=controller.value, age_s=_age(controller), problem=controller.problem),
            stop_reason=live.stop_reason.value or live.stop_reason.problem,
        )

    def _gauge(self, settings: GaugeSettings) -> GaugeSnapshot:
        shown = self._live.gauge(settings.name)
        return GaugeSnapshot(
            **settings.model_dump(include={"name", "axis", "sign", "travel_mm", "middle_mm"}),
            shown_mm=None if shown.value is None else shown.value.value_mm,
            age_s=_age(shown),
            noise_mm=self._noise(settings.name),
            problem=shown.problem,
        )

    def _noise(self, name: str) -> float | None:
        """Standard deviation of the latest readings; forgotten whenever the robot moves."""
        recent, shown = self._recent[name], self._live.gauge(name)
        if self.is_moving:
            recent.clear()
        elif shown.value is not None and (not recent or recent[-1][0] != shown.at_s):
            recent.append((shown.at_s, shown.value.value_mm))
        values = [value for _, value in recent]
        return stdev(values) if len(values) >= NOISE_READINGS // 2 else None


def _age(shown: LiveValue[Any]) -> float | None:
    return None if math.isinf(shown.age_s) else shown.age_s


async def watch_devices(cell: Cell) -> AsyncGenerator[LiveSnapshot, None]:
    """What the devices show, at most ten times a second, until the iterator is closed; nothing moves.

    Raises:
        CellBusy: a run has them.
        HexacellError: a protocol has no driver, or a simulated cell cannot start.
    """
    with cell_lock(*cell.config_paths), device_addresses(cell) as settings:
        links = SharedSerialPorts(trace=WireTrace())
        devices = devices_of(settings, links, WireTrace(), cell.path.parent)
        feed = LiveFeed(devices.live, settings.gauges)
        async with AsyncExitStack() as closing:
            closing.push_async_callback(links.close)
            closing.push_async_callback(devices.close)
            for source in sources(devices):
                reading = asyncio.ensure_future(_open_and_read(*source))
                closing.push_async_callback(cancel_and_wait, reading)
            yield feed.snapshot()
            async for _ in devices.live.changes():
                yield feed.snapshot()


async def _open_and_read(
    shown: LiveValue[Any], connect: Callable[[], Awaitable[Any]], read: Callable[[], Awaitable[Any]]
) -> None:
    """Open a device, as often as it takes, and read it; its live value says what is wrong."""
    while True:  # nothing reports when it is plugged in
        try:
            await connect()
            break
        except HexacellError as error:
            shown.fail(str(error))
        await asyncio.sleep(OPEN_EVERY_S)
    await keep_reading(shown, read, READ_EVERY_S)
