"""The driver against the real LinuxCNC: what no query tells, and what an acknowledgement hides."""

import asyncio
from functools import partial

import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.encoders.of_controller import ControllerScales
from drivers.errors import MoveRefused, PoseRefused
from drivers.interfaces import StartupAction
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.cell.loader import load_cell
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from tests.linuxcnc_orders import joints_of, pose_of

ALL = frozenset(StartupAction)
THERE = Pose(40.0, -20.0, 560.0, 5.0, -4.0, 10.0)
MOVE_S = 0.5


@pytest.fixture
async def driver(linuxcnc):
    made = LinuxcncrshController(load_cell(linuxcnc.folder / "cell.toml").settings.controller)
    await made.open()
    yield made
    await made.close()


async def distance(driver: LinuxcncrshController, pose: Pose) -> float:
    there = (await pose_of(driver)).as_tuple()
    return max(abs(one - other) for one, other in zip(there, pose.as_tuple(), strict=True))


async def test_it_gets_ready_moves_and_stops(driver) -> None:
    await driver.prepare(ALL)
    await driver.move(THERE, MOVE_S)
    assert await distance(driver, THERE) < 1e-3
    standing = (await driver.status()).heartbeat
    moving = asyncio.create_task(driver.move(Pose(-150.0, 100.0, 500.0), 60.0))
    while (await driver.status()).heartbeat == standing:
        pass
    await driver.stop()
    with pytest.raises(DeviceError, match="stopped"):
        await moving
    assert 0.0 < await distance(driver, THERE) < 150.0


async def test_a_rotated_coordinate_system_does_not_move_the_target(linuxcnc, driver) -> None:
    await driver.prepare(ALL)
    await driver.move(Pose(0.0, 0.0, 550.0), MOVE_S)
    with linuxcnc.connect() as client:
        assert "ACK" in client.ask("set mdi G10 L2 P1 R30")
    await driver.prepare(ALL)
    await driver.move(THERE, MOVE_S)
    assert await distance(driver, THERE) < 1e-3


async def test_a_program_in_inches_is_no_obstacle_and_stays_in_inches(linuxcnc, driver) -> None:
    await driver.prepare(ALL)
    with linuxcnc.connect() as client:
        assert "ACK" in client.ask("set mdi G20")
        await driver.prepare(ALL)
        await driver.move(THERE, MOVE_S)
        assert await distance(driver, THERE) < 1e-3
        assert "G20" in client.ask("get program_codes").split()


@pytest.mark.parametrize("block", ["G10 L2 P1 X5", "G92 X3", "G91"])
async def test_what_changes_coordinates_is_refused_before_a_move(linuxcnc, driver, block) -> None:
    await driver.prepare(ALL)
    with linuxcnc.connect() as client:
        assert "ACK" in client.ask(f"set mdi {block}")
    for look in (driver.check, partial(driver.prepare, ALL)):
        with pytest.raises(DeviceError, match=r"offset|relative"):
            await look()
    with pytest.raises(MoveRefused, match="its last preparation failed"):
        await driver.move(THERE, MOVE_S)


async def test_an_offset_that_outlives_linuxcnc_is_found_before_it_is_homed(linuxcnc, driver) -> None:
    await driver.prepare(ALL)
    with linuxcnc.connect() as client:
        assert "ACK" in client.ask("set mdi G10 L2 P1 Y5")
    await driver.close()
    linuxcnc.shut_down()
    linuxcnc.start()
    await driver.open()
    for look in (driver.check, partial(driver.prepare, ALL)):
        with pytest.raises(DeviceError, match="adds an offset of"):
            await look()
    with linuxcnc.connect() as client:
        assert client.ask("get joint_homed").split()[1:] == ["NO"] * 6


async def test_a_pose_beyond_a_limit_of_the_ini_is_refused_with_its_axis(driver) -> None:
    await driver.prepare(ALL)
    with pytest.raises(PoseRefused, match="limit") as caught:
        await driver.move(Pose(0.0, 0.0, 550.0, 50.0, 0.0, 0.0), MOVE_S)
    assert (caught.value.axis, caught.value.is_highest) == ("a", True)
    await driver.move(THERE, MOVE_S)


async def test_a_pose_that_the_kinematics_cannot_reach_is_refused(driver) -> None:
    await driver.prepare(ALL)
    with pytest.raises(MoveRefused):
        await driver.move(Pose(0.0, 0.0, 749.0, 40.0, 40.0, 55.0), MOVE_S)
    await driver.move(THERE, MOVE_S)


async def test_its_scales_are_read_also_during_a_move(linuxcnc, driver) -> None:
    settings = LinearEncoderSettings.model_validate({"protocol": "controller", "measuring_step_nm": 1})
    scales = ControllerScales(settings, driver)
    with pytest.raises(DeviceError, match="are not homed"):
        await scales.read()
    await driver.prepare(ALL)
    before = await scales.read()
    moving = asyncio.create_task(driver.move(THERE, 3.0))
    while (await scales.read()).counts == before.counts:
        assert not moving.done()
    on_the_way = await scales.read()
    await moving
    after = await scales.read()
    assert len({before.counts, on_the_way.counts, after.counts}) == 3
    assert after.positions == pytest.approx(await joints_of(driver), abs=1e-9)


async def test_a_frozen_server_is_told_and_it_goes_on_when_it_answers_again(linuxcnc, driver) -> None:
    await driver.prepare(ALL)
    standing = (await driver.status()).heartbeat
    moving = asyncio.create_task(driver.move(THERE, 5.0))
    while (await driver.status()).heartbeat == standing:
        pass
    linuxcnc.signal("STOP", "linuxcncrsh")
    try:
        with pytest.raises(DeviceError, match="Press the emergency stop") as caught:
            await driver.stop()
        assert "could not be stopped" in caught.value.problem
    finally:
        linuxcnc.signal("CONT", "linuxcncrsh")
    await asyncio.wait([moving])  # LinuxCNC itself was not frozen: it may have arrived
    await driver.prepare(ALL)
    await driver.move(Pose(0.0, 0.0, 550.0), MOVE_S)
    assert await distance(driver, Pose(0.0, 0.0, 550.0)) < 1e-3
