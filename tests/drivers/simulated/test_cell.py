"""A whole simulated cell: every device answers on the wire, through the real drivers."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.encoders.cia406 import Cia406Bank
from drivers.interfaces import StartupAction
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.model import CellSettings
from hexacell.kinematics.pose import Pose
from hexacell.plugins import Group, load
from tests.drivers.simulated.conftest import served
from tests.linuxcnc_orders import pose_of

ALL = frozenset(StartupAction)
MOVE_S = 1.0
SIGNS = (-1, 1, -1)


def quick(settings: CellSettings) -> CellSettings:
    """A cell with a fast clock, and long time-outs for a machine under load."""
    timing = settings.timing.model_copy(update={"clock_factor": 200.0})
    gauges = tuple(
        gauge.model_copy(update={"timeout_s": 10.0, "sign": sign})
        for gauge, sign in zip(settings.gauges, SIGNS, strict=True)
    )
    encoders = settings.encoders.model_copy(update={"timeout_s": 10.0, "heartbeat_ms": 10_000})
    return settings.model_copy(update={"timing": timing, "gauges": gauges, "encoders": encoders})


@asynccontextmanager
async def drivers(settings: CellSettings) -> AsyncIterator[tuple[list[Any], Any, Any]]:
    links = SharedSerialPorts()
    gauges = [load(Group.GAUGES, gauge.protocol)(gauge, links) for gauge in settings.gauges]
    encoders, controller = Cia406Bank(settings.encoders), LinuxcncrshController(settings.controller)
    try:
        await asyncio.gather(*(gauge.open() for gauge in gauges), encoders.open(), controller.open())
        yield gauges, encoders, controller
    finally:
        await asyncio.gather(*(gauge.close() for gauge in gauges), encoders.close(), controller.close())
        await links.close()


async def test_every_device_answers_and_the_robot_moves(bundled_cell) -> None:
    """Gauges count in the direction of their mounting."""
    target = Pose(3.0, -2.0, 548.0, 1.0, 0.0, 0.0)
    with served(bundled_cell, quick(bundled_cell.settings)) as cell:
        async with drivers(cell.settings) as (gauges, encoders, controller):
            await controller.prepare(ALL)
            before = (await encoders.read()).positions
            await controller.move(target, MOVE_S)
            after = (await encoders.read()).positions
            readings = [(await gauge.read()).value_mm for gauge in gauges]
            seen = [cell.physics.gauge_displacement(axis) for axis in "xyz"]
            assert (await pose_of(controller)).as_tuple() == pytest.approx(target.as_tuple(), abs=1e-3)
        assert before != after
        assert after == pytest.approx(cell.physics.encoder_positions().tolist(), abs=0.01)
        assert readings == pytest.approx(np.multiply(SIGNS, seen).tolist(), abs=0.05)
