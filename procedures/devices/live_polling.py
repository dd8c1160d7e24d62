"""Keeps live values fresh while a run waits for a person and reads nothing itself."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Any

from hexacell.errors import HexacellError
from procedures.devices.device_set import Devices
from procedures.devices.live_values import SAMPLE_PERIOD_S, LiveValue

OTHERS_PERIOD_S = 1.0
"""Encoders and controller may be guarded meanwhile, which reads them more often."""


async def poll_for_screens(devices: Devices, period_s: float = SAMPLE_PERIOD_S) -> None:
    """Read each device whenever its live value has become older than ``period_s``, until cancelled.

    Only reads that move nothing and change no setting. A device that fails is asked again.
    """
    live = devices.live
    gauges = [
        _poll(live.gauge(one.gauge.name), partial(devices.read_gauge_once, one.gauge), period_s)
        for one in devices.gauges
    ]
    others_s = max(period_s, OTHERS_PERIOD_S)
    await asyncio.gather(
        *gauges,
        _poll(live.encoders, devices.read_encoders, others_s),
        _poll(live.controller, devices.controller_status, others_s),
        _poll(live.stop_reason, devices.stop_reason, others_s),
    )


async def _poll(shown: LiveValue[Any], read: Callable[[], Awaitable[Any]], period_s: float) -> None:
    while True:
        if shown.age_s >= period_s:
            with suppress(HexacellError):  # the live value says why
                await read()
        await asyncio.sleep(period_s)
