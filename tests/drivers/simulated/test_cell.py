"""A whole simulated cell: every device answers on the wire, through the real drivers."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.encoders.cia406 import Cia406Bank
from drivers.interfaces import StartupAction
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.model import CellSettings
from hexacell.config.toml_format import native_layout
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import Pose
from hexacell.plugins import Group, load
from tests.drivers.simulated.conftest import served
from tests.geometries import hexaglide_geometry
from tests.linuxcnc_orders import pose_of

ALL = frozenset(StartupAction)
MOVE_S = 1.0


def serve(bundled_cell: Any, settings: CellSettings | None = None) -> Any:
    return served(bundled_cell, settings or quick(bundled_cell.settings))


def quick(settings: CellSettings) -> CellSettings:
    """A cell with a fast clock, and long time-outs for a machine under load."""
    timing = settings.timing.model_copy(update={"clock_factor": 200.0})
    gauges = tuple(gauge.model_copy(update={"timeout_s": 10.0}) for gauge in settings.gauges)
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
    target = Pose(3.0, -2.0, 548.0, 1.0, 0.0, 0.0)
    with serve(bundled_cell) as cell:
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
        assert readings == pytest.approx(seen, abs=0.05)


async def test_gauges_count_in_the_direction_of_their_mounting(bundled_cell) -> None:
    signs = (-1, 1, -1)
    settings = quick(bundled_cell.settings)
    gauges = tuple(
        gauge.model_copy(update={"sign": sign}) for gauge, sign in zip(settings.gauges, signs, strict=True)
    )
    with serve(bundled_cell, settings.model_copy(update={"gauges": gauges})) as cell:
        async with drivers(cell.settings) as (opened, _, _):
            readings = [(await gauge.read()).value_mm for gauge in opened]
        expected = [
            sign * cell.physics.gauge_displacement(axis) for sign, axis in zip(signs, "xyz", strict=True)
        ]
    assert readings == pytest.approx(expected, abs=0.05)


async def test_reloading_reads_the_config_and_moves_nothing(bundled_cell) -> None:
    with serve(bundled_cell) as cell:
        async with drivers(cell.settings) as (_, _, controller):
            await controller.prepare(ALL)
            sliders, believed = cell.machine.joints(), await pose_of(controller)
            config = bundled_cell.config_path
            values = bundled_cell.settings.simulation.geometry.model_dump()
            truth = hexaglide_geometry(values["S"], values["B"], values["l"])
            config.write_text(native_layout(HEXAGLIDE_PARAMETERS).rewrite([config.read_text()], truth)[0])
            await controller.reload(ALL)
            assert cell.machine.joints() == pytest.approx(sliders, abs=1e-6)
            assert (await pose_of(controller)).position != pytest.approx(believed.position, abs=0.5)
