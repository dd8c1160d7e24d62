"""The devices of a cell that no run has, each read on its own: one that is silent hides no other."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AsyncExitStack, suppress
from functools import partial
from typing import Any

from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import WireTrace
from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError
from hexacell.run_process.live_feed import LiveFeed
from hexacell.run_process.snapshots import LiveSnapshot
from hexacell.runs.cell_lock import cell_lock
from hexacell.services.devices.device_setup import device_addresses, devices_of
from procedures.devices.device_set import Devices
from procedures.devices.live_values import LiveValue
from procedures.run.cancellation import cancel_and_wait

READ_EVERY_S = 0.2
OPEN_EVERY_S = 1.0
"""A device that could not be opened is tried again."""


async def watch_devices(cell: Cell) -> AsyncIterator[LiveSnapshot]:
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
            for keep in _keepers(devices):
                closing.push_async_callback(cancel_and_wait, asyncio.ensure_future(keep))
            yield feed.snapshot()
            async for _ in devices.live.changes():
                yield feed.snapshot()


def _keepers(devices: Devices) -> Iterator[Awaitable[None]]:
    live = devices.live
    for one in devices.gauges:
        read = partial(devices.read_gauge_once, one.gauge)
        yield _keep_reading(live.gauge(one.gauge.name), one.gauge.open, read)
    yield _keep_reading(live.encoders, devices.encoders.open, devices.read_encoders)
    yield _keep_reading(live.controller, devices.controller.open, devices.controller_status)
    yield _keep_reading(live.stop_reason, devices.stop_input.open, devices.stop_reason)


async def _keep_reading(
    shown: LiveValue[Any], connect: Callable[[], Awaitable[Any]], read: Callable[[], Awaitable[Any]]
) -> None:
    """Open a device, as often as it takes, and read it; its live value says what is wrong."""
    while not await _is_open(shown, connect):  # noqa: ASYNC110 - nothing tells when it is plugged in
        await asyncio.sleep(OPEN_EVERY_S)
    while True:
        with suppress(HexacellError):  # the live value says why
            await read()
        await asyncio.sleep(READ_EVERY_S)


async def _is_open(shown: LiveValue[Any], connect: Callable[[], Awaitable[Any]]) -> bool:
    try:
        await connect()
    except HexacellError as error:
        shown.fail(str(error))
        return False
    return True
