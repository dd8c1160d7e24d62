"""Stopping: over a separate connection, until the machine is at rest."""

import asyncio

import pytest

from drivers.errors import MotionInterrupted
from hexacell.errors import DeviceError
from tests.drivers.controllers.linuxcnc import conftest as wire
from tests.linuxcnc_orders import joints_of


async def test_stopping_goes_over_a_second_connection_while_the_first_is_mute(play):
    aborted = play.Pause()
    driver = await play.opened(
        [
            (wire.MDI, aborted, wire.ACK),
            ("get abs_act_pos", wire.HALF_WAY),
            wire.AGAIN_IN_CONTROL,
            *wire.MOVED,
            wire.RESTORED,
        ],
        [*play.GREETING, *play.STOPPED],
    )
    moving = await aborted.reached_by(driver.move(wire.TARGET, wire.MOVE_S))
    await driver.stop()
    aborted.set()
    with pytest.raises(MotionInterrupted, match=r"stopped at X5\.000 .*: it was stopped on request"):
        await moving
    await driver.move(wire.TARGET, wire.MOVE_S)


async def test_no_command_is_sent_on_one_connection_while_the_other_awaits_an_answer(play):
    """LinuxCNC 2.9 garbles commands of two clients that coincide."""
    speak = play.Pause()
    driver = await play.opened(
        [(wire.MDI, wire.ACK), ("get abs_act_pos", wire.HALF_WAY)],
        [*play.GREETING, ("set abort", speak, b"SET ABORT ACK\n\r"), *play.STOPPING[-3:]],
    )
    moving = asyncio.create_task(driver.move(wire.TARGET, wire.MOVE_S))
    await asyncio.sleep(0)
    stopping = await speak.reached_by(driver.stop())
    silent_so_far = not moving.done()
    speak.set()
    await stopping
    with pytest.raises(MotionInterrupted):
        await moving
    assert silent_so_far


async def test_the_abort_is_repeated_while_the_machine_moves_and_a_refused_one_at_rest_counts(play) -> None:
    moving = wire.said("set abort | get joint_pos: 1 0 0 0 0 0 | get joint_pos: 2 0 0 0 0 0")
    at_rest = wire.said("set enable EMCTOO | set abort") + wire.said("get joint_pos: 3 0 0 0 0 0") * 3
    driver = await play.opened([], [*play.GREETING, *moving, *at_rest])
    await driver.stop()
    driver = await play.opened([], [*play.GREETING, *wire.said("set abort: NAK"), *play.STOPPED[1:]])
    await driver.stop()


async def test_a_machine_that_keeps_moving_after_the_abort_is_reported(play):
    play.patience = play.IMPATIENT
    driver = await play.opened([], play.GREETING)
    play.servers[0].afterwards = {
        **dict(wire.said("set enable EMCTOO | set abort")),
        "get joint_pos": [f"JOINT_POS {n} 0 0 0 0 0\r\n".encode() for n in range(100_000)],
    }
    with pytest.raises(DeviceError, match=r"still moves 0\.6 s after .*Press the emergency stop"):
        await driver.stop()


async def test_stopping_repeats_a_greeting_that_was_garbled(play):
    driver = await play.opened([], [("hello EMC hexacell 1.0", b"HELLO NAK\r\n")], play.STOPPING)
    await driver.stop()


async def test_two_stops_at_once_do_not_disturb_each_other(play):
    speak = play.Pause()
    first = [*play.GREETING, ("set abort", speak, b"SET ABORT ACK\n\r"), *play.STOPPING[-3:]]
    driver = await play.opened([], first, play.STOPPING)
    stopping = [asyncio.create_task(driver.stop()) for _ in range(2)]
    await speak.reached.wait()
    connections_so_far = play.servers[0].connections
    speak.set()
    await asyncio.gather(*stopping)
    assert connections_so_far == 2


async def test_the_driver_does_not_reconnect_during_a_stop(play):
    speak = play.Pause()
    joints = wire.JOINTS
    driver = await play.opened(
        [(*joints, play.HANG_UP)],
        [*play.GREETING, ("set abort", speak, b"SET ABORT ACK\n\r"), *play.STOPPING[-3:]],
        [*play.OPENING[:-1], joints],
    )
    await joints_of(driver)
    stopping = asyncio.create_task(driver.stop())
    asking = await speak.reached_by(joints_of(driver))
    connections_so_far = play.servers[0].connections
    speak.set()
    await asyncio.gather(stopping, asking)
    assert connections_so_far == 2


async def test_a_move_that_waits_for_its_turn_is_not_begun_after_a_stop(play):
    answer = play.Pause()
    abort = play.Pause()
    driver = await play.opened(
        [("get joint_pos", answer, b"JOINT_POS 1 2 3 4 5 6\r\n"), wire.AGAIN_IN_CONTROL],
        [*play.GREETING, ("set abort", abort, b"SET ABORT ACK\n\r"), *play.STOPPING[-3:]],
    )
    asking = asyncio.create_task(joints_of(driver))
    moving = await answer.reached_by(driver.move(wire.TARGET, wire.MOVE_S))
    stopping = await abort.reached_by(driver.stop())
    abort.set()
    answer.set()
    await asking
    with pytest.raises(MotionInterrupted, match="was stopped before it moved"):
        await moving
    await stopping
