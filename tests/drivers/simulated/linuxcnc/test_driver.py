"""The driver and the simulated controller over a real socket: they must agree, faults included."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from functools import partial

import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.controllers.linuxcnc.protocol import Timeouts
from drivers.errors import (
    ConnectionLost,
    MotionInterrupted,
    MoveRefused,
    PoseRefused,
    ResponseTimeout,
    StartupNotPermitted,
)
from drivers.interfaces import StartupAction
from drivers.simulated.linuxcnc.mdi import ModalState
from drivers.simulated.linuxcnc.server import SimulatedController
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from tests.drivers.simulated.linuxcnc.conftest import QUICK

ALL = frozenset(StartupAction)
MOVE_S = 0.1
TARGET = Pose(100.0, -200.0, 550.0, 12.5, -3.0, 8.0)
HOME = Pose(0.0, 0.0, 0.0)
LONG_S = 30.0  # slow enough to be stopped on the way, quick enough to be seen moving


@pytest.fixture
async def ready(driver):
    """A driver that has prepared the machine."""
    made = driver()
    await made.open()
    await made.prepare(ALL)
    yield made
    await made.close()


async def begin(ready, machine):
    """A long move that has started."""
    machine.duration_s = LONG_S
    machine.events.clear()
    moving = asyncio.create_task(ready.move(TARGET, MOVE_S))
    await asyncio.to_thread(machine.wait_for, "move")
    return moving


async def test_a_rotation_that_no_query_tells_does_not_move_the_target(ready, simulated, machine):
    simulated.state.modes = replace(simulated.state.modes, rotation_deg=30.0)
    await ready.move(TARGET, MOVE_S)
    assert machine.pose() == TARGET


@pytest.mark.parametrize(
    "modes", [{"offset": (0.0, 0.0, -5.0, 0.0, 0.0, 0.0)}, {"work_offset": (1.0,) * 6}]
)
async def test_an_offset_is_found_before_anything_moves(driver, simulated, machine, modes):
    simulated.state.modes = replace(simulated.state.modes, **modes)
    controller = driver()
    await controller.open()
    for look in (controller.check, partial(controller.prepare, ALL)):
        with pytest.raises(DeviceError, match=r"adds an offset of .*\(G54, G92\)"):
            await look()
    assert machine.events == ["on"]
    with pytest.raises(MoveRefused, match="its last preparation failed"):
        await controller.move(TARGET, MOVE_S)
    simulated.state.modes = ModalState()
    await controller.check()
    await controller.prepare(ALL)
    await controller.move(TARGET, MOVE_S)
    assert machine.events == ["on", "home", "move"]
    await controller.close()


async def test_an_inch_machine_is_commanded_and_told_in_mm(machine):
    inches = ControllerSettings(config="machine.ini", unit_mm=25.4)
    with SimulatedController(machine, inches) as server:
        controller = LinuxcncrshController(inches.model_copy(update={"port": server.port}), timeouts=QUICK)
        await controller.open()
        await controller.prepare(ALL)
        await controller.move(TARGET, MOVE_S)
        assert machine.pose() == TARGET
        assert (await controller.pose()).as_tuple() == pytest.approx(TARGET.as_tuple(), abs=2e-5)
        assert await controller.joint_positions() == pytest.approx(TARGET.as_tuple(), abs=2e-5)
        await controller.close()
        plain = ControllerSettings(config="machine.ini", port=server.port)
        controller = LinuxcncrshController(plain, timeouts=QUICK)
        await controller.open()
        with pytest.raises(DeviceError, match=r"counts in inch.*Set controller.unit_mm = 25\.4"):
            await controller.check()
        await controller.close()


async def test_from_emergency_stop_to_a_pose(driver, machine):
    controller = driver()
    try:
        assert (await controller.open()).description == "EMCNETSVR 1.1, machine.ini"
        assert machine.events == []
        await controller.prepare(ALL)
        assert machine.events == ["on", "home"]
        await controller.move(TARGET, MOVE_S)
        assert await controller.pose() == TARGET
        assert await controller.joint_positions() == TARGET.as_tuple()
        await controller.prepare(ALL)
        assert machine.events == ["on", "home", "move"]
    finally:
        await controller.close()


async def test_a_move_of_an_unprepared_machine_is_refused_with_the_reason(driver):
    controller = driver()
    await controller.open()
    with pytest.raises(MoveRefused, match="it is in emergency stop"):
        await controller.move(TARGET, MOVE_S)
    await controller.close()


async def test_a_move_after_a_target_out_of_reach(ready):
    with pytest.raises(MoveRefused, match="Linear move on line 0 fails kinematicsInverse"):
        await ready.move(Pose(0.0, 0.0, 5000.0), MOVE_S)
    await ready.move(TARGET, MOVE_S)
    assert await ready.pose() == TARGET


async def test_a_stop_during_a_move_ends_it_in_place(ready, machine):
    moving = await begin(ready, machine)
    await ready.stop()
    with pytest.raises(MotionInterrupted, match="it was stopped on request"):
        await moving
    stood = await ready.pose()
    assert 0.0 <= stood.x < 90.0
    machine.duration_s = 0.01
    await ready.move(TARGET, MOVE_S)
    assert await ready.pose() == TARGET


async def test_a_stop_that_overtakes_its_move(ready, machine):
    """The abort may overtake the move that it is meant for."""
    machine.duration_s = LONG_S
    moving = asyncio.create_task(ready.move(TARGET, MOVE_S))
    await asyncio.sleep(0)
    await ready.stop()
    with pytest.raises(MotionInterrupted):
        await moving


async def test_a_stop_is_repeated_until_it_has_an_effect(ready, machine):
    moving = await begin(ready, machine)
    machine.ignored_stops = 2
    await ready.stop()
    with pytest.raises(MotionInterrupted):
        await moving
    assert machine.ignored_stops == 0


async def test_a_cancelled_move_stops_the_machine_and_the_next_one_is_executed(ready, machine):
    moving = await begin(ready, machine)
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    stood = await ready.pose()
    assert stood == await ready.pose()
    assert stood.x < 90.0
    machine.duration_s = 0.01
    await ready.move(TARGET, MOVE_S)


async def test_a_move_that_takes_too_long(driver, machine):
    controller = driver(replace(QUICK, beyond_move=0.8))
    await controller.open()
    await controller.prepare(ALL)
    machine.duration_s = LONG_S
    with pytest.raises(MotionInterrupted, match=r"still moving after 1 s"):
        await controller.move(TARGET, MOVE_S)
    machine.duration_s = 0.01
    await controller.move(HOME, MOVE_S)
    await controller.close()


async def test_stopping_while_homing(driver, machine):
    machine.duration_s = LONG_S
    controller = driver()
    await controller.open()
    preparing = asyncio.create_task(controller.prepare(ALL))
    await asyncio.to_thread(machine.wait_for, "home")
    await controller.stop()
    with pytest.raises(MotionInterrupted, match="was stopped before it was ready"):
        await preparing
    machine.duration_s = 0.01
    await controller.prepare(ALL)
    await controller.move(TARGET, MOVE_S)
    await controller.close()


async def test_an_unreachable_pose_while_another_client_waits_for_no_completion(ready, simulated):
    """``set_wait received`` is global in 2.9: NAK becomes ACK, and only the position tells."""
    simulated.state.waits = False
    with pytest.raises(PoseRefused, match="fails kinematicsInverse"):
        await ready.move(Pose(0.0, 0.0, 5000.0), MOVE_S)
    await ready.prepare(ALL)
    with pytest.raises(MoveRefused):
        await ready.move(Pose(0.0, 0.0, 5000.0), MOVE_S)


async def test_another_client_takes_control_and_gives_it_back(ready, driver):
    other = driver()
    await other.open()
    with pytest.raises(MoveRefused, match="another client has taken control"):
        await ready.move(TARGET, MOVE_S)
    await ready.prepare(ALL)
    await ready.move(TARGET, MOVE_S)
    await other.close()


async def test_reloading_reads_the_config_and_moves_no_slider(ready, machine):
    await ready.move(TARGET, MOVE_S)
    machine.config = 2.5
    await ready.reload(ALL)
    assert await ready.joint_positions() == TARGET.as_tuple()
    assert (await ready.pose()).x == TARGET.x - 2.5
    await ready.move(TARGET, MOVE_S)
    assert (await ready.joint_positions())[0] == TARGET.x + 2.5


async def test_a_config_that_cannot_be_used(ready, machine):
    machine.config = None
    with pytest.raises(DeviceError, match=r"does not switch on: machine\.ini: has no geometry"):
        await ready.reload(ALL)


async def test_a_slider_that_jumps_when_the_machine_is_switched_on(ready, machine):
    machine.jump_mm = 6.8
    with pytest.raises(DeviceError, match=r"moved joint 1 by 6\.800 mm"):
        await ready.reload(ALL)


async def test_a_silent_controller(driver, simulated):
    controller = driver(Timeouts(answer=1.0))
    await controller.open()
    simulated.set_silent(on=True)
    with pytest.raises(ResponseTimeout, match="did not answer 'get abs_act_pos'"):
        await controller.pose()
    simulated.set_silent(on=False)
    assert await controller.pose() == HOME
    await controller.close()


async def test_a_refused_password(driver):
    with pytest.raises(DeviceError, match="refuses the connect password"):
        await driver(connect_password="WRONG").open()


async def test_a_refused_move(ready, machine):
    machine.refusal = "joint 3 following error"
    with pytest.raises(MoveRefused, match="joint 3 following error"):
        await ready.move(TARGET, MOVE_S)
    machine.refusal = ""
    await ready.move(TARGET, MOVE_S)


async def test_an_acknowledged_move_that_does_not_take_place(ready, machine):
    machine.ignored_moves = 1
    with pytest.raises(MotionInterrupted, match=r"stopped at X0\.000 .* before reaching X100\.000"):
        await ready.move(TARGET, MOVE_S)
    await ready.move(TARGET, MOVE_S)


async def test_a_connection_cut_during_a_move(ready, simulated, machine):
    moving = await begin(ready, machine)
    simulated.set_unplugged(on=True)
    simulated.set_unplugged(on=False)
    with pytest.raises(ConnectionLost, match="closed the connection"):
        await moving
    stood = await ready.pose()
    assert stood == await ready.pose()
    assert stood.x < 90.0


async def test_an_emergency_stop_during_a_move(ready, simulated, machine):
    moving = await begin(ready, machine)
    simulated.state.set_estop(on=True)
    with pytest.raises(MotionInterrupted, match="it is in emergency stop"):
        await moving
    machine.duration_s = 0.01
    with pytest.raises(StartupNotPermitted, match=r"is in emergency stop$"):
        await ready.prepare(ALL - {StartupAction.RESET_ESTOP})
    assert simulated.state.estop
    await ready.prepare(ALL)
    await ready.move(TARGET, MOVE_S)


async def test_a_controller_that_is_closed(ready, simulated):
    await asyncio.to_thread(simulated.close)
    with pytest.raises(ConnectionLost, match="cannot be reached: Connection refused"):
        await ready.pose()
    with pytest.raises(DeviceError, match="could not be stopped: it cannot be reached"):
        await ready.stop()


async def test_a_frozen_controller_and_one_that_was_ended_are_told_apart(driver, simulated) -> None:
    hasty = driver(Timeouts(connect=0.5, answer=0.2, stop=1.0))
    await hasty.open()
    await hasty.prepare(ALL)
    before = await hasty.status()
    simulated.set_frozen(on=True)
    assert await hasty.status() == before, "its server still answers"
    with pytest.raises(DeviceError, match="not be stopped: it is frozen: it is connected, but did not"):
        await hasty.stop()
    simulated.set_frozen(on=False)
    await hasty.stop()
    simulated.set_silent(on=True)
    with pytest.raises(DeviceError, match="not be stopped: it is frozen: it accepts the connection but"):
        await hasty.stop()
    simulated.set_unplugged(on=True)
    with pytest.raises(DeviceError, match="could not be stopped: it closed the connection: it was ended"):
        await hasty.stop()
    await asyncio.to_thread(simulated.close)
    with pytest.raises(DeviceError, match="could not be stopped: it cannot be reached: Connection refused"):
        await hasty.stop()
    await hasty.close()


async def test_a_controller_that_works_again_executes_what_it_is_told(ready, simulated) -> None:
    simulated.set_frozen(on=True)
    simulated.set_frozen(on=False)
    await ready.move(TARGET, MOVE_S)
    assert await ready.pose() == TARGET


async def test_the_heartbeat_changes_with_the_position(ready) -> None:
    before = (await ready.status()).heartbeat
    assert (await ready.status()).heartbeat == before
    await ready.move(TARGET, MOVE_S)
    assert (await ready.status()).heartbeat not in {before, ""}


async def test_a_move_lasts_as_long_as_it_is_told_and_leaves_the_modes_as_they_were(
    ready, simulated, machine
) -> None:
    simulated.state.modes = ModalState(1, 94, 250.0)
    await ready.prepare(ALL)
    await ready.move(TARGET, 2.5)
    assert machine.durations_s == [pytest.approx(2.5)]
    assert simulated.state.modes == ModalState(1, 94, 250.0)


async def test_the_modes_are_restored_on_closing_after_a_stop(ready, simulated, machine) -> None:
    moving = await begin(ready, machine)
    await ready.stop()
    with pytest.raises(MotionInterrupted):
        await moving
    assert simulated.state.modes.feed_mode == 93
    await ready.close()
    assert simulated.state.modes == ModalState()
