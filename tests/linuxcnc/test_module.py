"""LinuxCNC by its own Python module, against the real one: the driver, its faults, a whole calibration."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from statistics import median

import pytest

from drivers.controllers.linuxcnc.controller import (
    LinuxcncModuleController,
    LinuxcncOptions,
    LinuxcncrshController,
)
from drivers.errors import ConnectionLost, MotionInterrupted, MoveRefused, PoseRefused, StartupNotPermitted
from drivers.interfaces import Controller, StartupAction
from hexacell.cell.loader import load_cell
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from tests.linuxcnc.conftest import LinuxCNC
from tests.linuxcnc.server_client import ServerClient
from tests.linuxcnc.test_calibration import RUN, require_passed, shorten, written

pytestmark = pytest.mark.timeout(1200)

ALL = frozenset(StartupAction)
THERE, BACK = Pose(40.0, -20.0, 560.0, 5.0, -4.0, 10.0), Pose(0.0, 0.0, 550.0)
MOVE_S = 0.5
OVERHEAD_S = 0.02


def settings_of(machine: LinuxCNC) -> ControllerSettings:
    """The controller of a bundled cell, by the module."""
    settings = load_cell(machine.folder / "cell.toml").settings.controller
    return settings.model_copy(update={"options": LinuxcncOptions(), "protocol": "linuxcnc"})


@pytest.fixture
async def driver(linuxcnc: LinuxCNC) -> AsyncIterator[LinuxcncModuleController]:
    made = LinuxcncModuleController(settings_of(linuxcnc))
    await made.open()
    yield made
    await made.close()


def send(client: ServerClient, block: str) -> None:
    """Have linuxcncrsh send a block; what it knows of the machine is what it was asked for last."""
    assert client.ask("get machine") == "MACHINE ON"
    for command in ("set mode mdi", f"set mdi {block}"):
        assert "ACK" in client.ask(command)


async def is_at(driver: Controller, pose: Pose) -> bool:
    reported = await driver.position()
    assert reported is not None
    apart = (abs(a - b) for a, b in zip(reported.pose.as_tuple(), pose.as_tuple(), strict=True))
    return max(apart) < 1e-3


async def begun(driver: Controller, pose: Pose, duration_s: float) -> asyncio.Task[None]:
    """A move that is on its way."""
    standing = (await driver.status()).heartbeat
    moving = asyncio.create_task(driver.move(pose, duration_s))
    while (await driver.status()).heartbeat == standing and not moving.done():
        pass
    return moving


async def test_it_gets_ready_moves_and_stops(driver: Controller) -> None:
    with pytest.raises(StartupNotPermitted):
        await driver.prepare(frozenset())
    assert await driver.position() is None
    await driver.prepare(ALL)
    await driver.move(THERE, MOVE_S)
    assert await is_at(driver, THERE)
    moving = await begun(driver, Pose(-150.0, 100.0, 500.0), 60.0)
    await driver.stop()
    with pytest.raises(DeviceError, match="stopped"):
        await moving
    assert not await is_at(driver, THERE)
    await driver.move(BACK, MOVE_S)
    assert await is_at(driver, BACK)


async def test_joints_are_those_of_linuxcncrsh(linuxcnc, driver) -> None:
    await driver.prepare(ALL)
    await driver.move(THERE, MOVE_S)
    other = LinuxcncrshController(load_cell(linuxcnc.folder / "cell.toml").settings.controller)
    await other.open()
    expected = await other.position()
    await other.close()
    assert expected is not None
    assert await driver.joints_now() == pytest.approx(expected.joints, abs=1e-5)


async def test_what_it_refuses_is_named_with_its_axis(driver: Controller) -> None:
    await driver.prepare(ALL)
    with pytest.raises(PoseRefused, match="limit") as caught:
        await driver.move(Pose(0.0, 0.0, 550.0, 50.0, 0.0, 0.0), MOVE_S)
    assert (caught.value.axis, caught.value.is_highest) == ("a", True)
    with pytest.raises(MoveRefused):
        await driver.move(Pose(0.0, 0.0, 749.0, 40.0, 40.0, 55.0), MOVE_S)
    await driver.move(THERE, MOVE_S)
    assert await is_at(driver, THERE)


@pytest.mark.parametrize("block", ["G10 L2 P1 X5", "G92 X3", "G91"])
async def test_what_changes_coordinates_is_refused(linuxcnc, driver, block) -> None:
    await driver.prepare(ALL)
    with linuxcnc.connect() as client:
        send(client, block)
    with pytest.raises(DeviceError, match=r"offset|relative"):
        await driver.move(THERE, MOVE_S)


async def test_a_program_in_inches_stays_in_inches(linuxcnc, driver) -> None:
    await driver.prepare(ALL)
    with linuxcnc.connect() as client:
        send(client, "G20")
        await driver.move(THERE, MOVE_S)
        assert await is_at(driver, THERE)
        assert "G20" in client.ask("get program_codes").split()


async def emergency_stop(machine: LinuxCNC) -> None:
    with machine.connect() as client:
        client.send("set estop on")


async def command(machine: LinuxCNC, call: str) -> None:
    """What another program does that has LinuxCNC's module, as AXIS."""
    code = f"import linuxcnc; linuxcnc.command().{call}"
    done = await asyncio.create_subprocess_exec("/usr/bin/python3", "-c", code)
    assert await done.wait() == 0


async def crash(machine: LinuxCNC) -> None:
    await asyncio.to_thread(machine.kill)


@pytest.mark.parametrize(
    ("fault", "words"),
    [(emergency_stop, "controller LinuxCNC"), (crash, "LinuxCNC (has ended|does not run)")],
)
async def test_a_fault_in_a_move_is_named(
    linuxcnc: LinuxCNC, driver: Controller, fault: Callable[[LinuxCNC], Awaitable[None]], words: str
) -> None:
    await driver.prepare(ALL)
    moving = await begun(driver, THERE, 20.0)
    await fault(linuxcnc)
    with pytest.raises(DeviceError, match=words):
        await moving
    with pytest.raises(DeviceError):
        await driver.move(BACK, MOVE_S)
    if not linuxcnc.is_running:
        with pytest.raises(DeviceError, match="does not run on this computer"):
            await driver.prepare(ALL)
        await asyncio.to_thread(linuxcnc.start)
    await driver.prepare(ALL)
    await driver.move(BACK, MOVE_S)
    assert await is_at(driver, BACK)


async def test_another_client_may_turn_the_override_but_not_take_the_mode(linuxcnc, driver) -> None:
    """By the module too: linuxcncrsh refuses to command while a block is executed."""
    await driver.prepare(ALL)
    moving = await begun(driver, THERE, 1.0)
    await command(linuxcnc, "feedrate(0.8)")
    await moving
    moving = await begun(driver, BACK, 20.0)
    await command(linuxcnc, "mode(linuxcnc.MODE_MANUAL)")
    with pytest.raises(MotionInterrupted, match="another client has put it into"):
        await moving
    for pose in (BACK, THERE):
        with pytest.raises(MoveRefused, match="last move failed"):
            await driver.move(pose, MOVE_S)
    await driver.prepare(ALL)
    await driver.move(BACK, MOVE_S)
    await command(linuxcnc, "mode(linuxcnc.MODE_MANUAL)")
    with pytest.raises(MoveRefused, match="another client has put it into manual mode"):
        await driver.move(THERE, MOVE_S)
    await driver.prepare(ALL)
    await driver.move(THERE, MOVE_S)
    assert await is_at(driver, THERE)


async def test_a_frozen_task_moves_nothing_when_it_goes_on(linuxcnc, driver) -> None:
    await driver.prepare(ALL)
    await driver.move(BACK, MOVE_S)
    linuxcnc.signal("STOP", "milltask")
    try:
        with pytest.raises(DeviceError, match=r"could not be stopped: .*frozen"):
            await driver.move(THERE, MOVE_S)
        await driver.close()
    finally:
        linuxcnc.signal("CONT", "milltask")
    await driver.open()
    await driver.prepare(ALL)
    assert await is_at(driver, BACK)
    await driver.move(THERE, MOVE_S)
    assert await is_at(driver, THERE)


async def test_a_task_that_ended_is_told_when_nothing_moves(linuxcnc, driver) -> None:
    await driver.prepare(ALL)
    await crash(linuxcnc)
    with pytest.raises(ConnectionLost, match="LinuxCNC has ended"):
        await driver.status()
    await asyncio.to_thread(linuxcnc.start)


async def test_a_move_costs_little_more_than_by_linuxcncrsh(linuxcnc, driver) -> None:
    async def taken_s(by: Controller) -> float:
        await by.prepare(ALL)
        taken = []
        for pose in 6 * (THERE, BACK):
            begin = time.perf_counter()
            await by.move(pose, MOVE_S)
            taken.append(time.perf_counter() - begin)
        return median(taken)

    by_module = await taken_s(driver)
    other = LinuxcncrshController(load_cell(linuxcnc.folder / "cell.toml").settings.controller)
    await other.open()
    by_shell = await taken_s(other)
    await other.close()
    print(f"\na move by the module {1e3 * by_module:.1f} ms, by linuxcncrsh {1e3 * by_shell:.1f} ms")
    assert by_module - by_shell < OVERHEAD_S


def test_a_stock_hexapod_is_calibrated(hexapod: LinuxCNC) -> None:
    cell = hexapod.folder / "cell.toml"
    cell.write_text(cell.read_text().replace('protocol = "linuxcncrsh"', 'protocol = "linuxcnc"', 1))
    assert load_cell(cell).settings.controller.protocol == "linuxcnc"
    shorten(hexapod)
    before = written(hexapod)
    require_passed(hexapod, hexapod.hexacell(*RUN))
    assert written(hexapod) != before
