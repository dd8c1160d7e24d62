"""The status of the machine, read over a second connection while the first one waits for a move."""

import asyncio

import pytest

from drivers.errors import MotionInterrupted, MoveRefused
from drivers.interfaces import ControllerStatus, StartupAction
from hexacell.errors import DeviceError
from tests.drivers.controllers.linuxcnc import conftest as wire

JOINTS = "1.000000 2.000000 3.000000 4.000000 5.000000 6.000000"


def asked(*, estop: str = "OFF", machine: str = "ON") -> list[tuple[str, bytes]]:
    return wire.said(f"get machine: {machine} | get estop: {estop} | get joint_pos: {JOINTS}")


LOOKING_ON = wire.GREETING[:3]
"""Whoever only looks on does not take control."""
ON = ControllerStatus(estop=False, enabled=True, heartbeat=JOINTS)


async def test_an_emergency_stop_while_the_status_is_read_is_told_as_one(play) -> None:
    driver = await play.opened([], [*LOOKING_ON, *asked(machine="ON", estop="ON")])
    assert (await driver.status()).estop


async def test_the_status_is_read_without_taking_control(play) -> None:
    driver = await play.opened([], [*LOOKING_ON, *asked(), *asked()])
    assert await driver.status() == ON
    assert await driver.status() == ON
    assert play.servers[0].connections == 2


async def test_error_messages_are_read_when_the_machine_switches_off(play) -> None:
    told = [*TURNED_OFF, FAULT, wire.NO_ERROR, *TURNED_OFF, wire.NO_ERROR]
    driver = await play.opened([], [*LOOKING_ON, *asked(), *told])
    assert await driver.status() == ON
    for _ in range(2):
        status = await driver.status()
        assert status == ControllerStatus(False, False, ("joint 3 following error",), JOINTS)
        assert not status.may_move


[FAULT] = wire.said("get error: joint 3 following error")
TURNED_OFF = asked(machine="OFF")


async def test_status_has_the_messages_that_the_order_is_reading(play) -> None:
    """LinuxCNC gives a message once; here the command's connection gets it and is still reading."""
    reading = play.Pause()
    main = [*wire.REFUSED, FAULT, ("get error", reading, b"ERROR OK\r\n")]
    driver = await play.opened(main, [*LOOKING_ON, *asked(), *TURNED_OFF, wire.NO_ERROR])
    await driver.status()
    moving = await reading.reached_by(driver.move(wire.TARGET, wire.MOVE_S))
    status = asyncio.create_task(driver.status())
    reading.set()
    assert (await status).error_messages == ("joint 3 following error",)
    with pytest.raises(MoveRefused, match="joint 3 following error"):
        await moving


async def test_an_order_has_the_messages_that_the_status_read(play) -> None:
    refused = play.Pause()
    main = [(wire.MDI, refused, wire.NAK), *wire.said("get enable: ON | get error: OK")]
    driver = await play.opened(main, [*LOOKING_ON, *asked(), *TURNED_OFF, FAULT, wire.NO_ERROR])
    await driver.status()
    moving = await refused.reached_by(driver.move(wire.TARGET, wire.MOVE_S))
    assert (await driver.status()).error_messages == ("joint 3 following error",)
    refused.set()
    with pytest.raises(MoveRefused, match="joint 3 following error"):
        await moving


async def test_a_message_whose_reading_is_cancelled_is_kept(play) -> None:
    reading = play.Pause()
    message = ("get error", reading, FAULT[1])
    told = [*TURNED_OFF, message, wire.NO_ERROR, *TURNED_OFF, wire.NO_ERROR]
    driver = await play.opened([], [*LOOKING_ON, *asked(), *told])
    await driver.status()
    cancelled = await reading.reached_by(driver.status())
    cancelled.cancel()
    reading.set()
    with pytest.raises(asyncio.CancelledError):
        await cancelled
    assert (await driver.status()).error_messages == ("joint 3 following error",)


async def test_a_machine_that_goes_off_between_its_preparation_and_the_first_status_tells_why(play) -> None:
    preparation = [
        *wire.TAKING_CONTROL,
        *wire.SWITCHING_ON,
        *wire.READY,
        *wire.MDI_MODE,
        *wire.OWN_COORDINATES,
    ]
    driver = await play.opened(preparation, [*LOOKING_ON, *TURNED_OFF, FAULT, wire.NO_ERROR])
    await driver.prepare(frozenset({StartupAction.SWITCH_ON}))
    assert (await driver.status()).error_messages == ("joint 3 following error",)


async def test_the_status_is_read_during_a_move(play) -> None:
    arrived = play.Pause()
    main = [(wire.MDI, arrived, wire.ACK), wire.MOVED[1], wire.RESTORED]
    driver = await play.opened(main, [*LOOKING_ON, *asked()])
    moving = await arrived.reached_by(driver.move(wire.TARGET, wire.MOVE_S))
    assert await driver.status() == ON
    assert not moving.done()
    arrived.set()
    await moving


async def test_stopping_uses_the_status_connection_unless_it_does_not_answer(play) -> None:
    driver = await play.opened([], [*LOOKING_ON, *asked(), wire.AGAIN_IN_CONTROL, *play.STOPPED])
    await driver.status()
    await driver.stop()
    assert play.servers[0].connections == 2, "no time is lost on opening a third one"
    driver = await play.opened(
        [], [*LOOKING_ON, *asked(), ("set enable EMCTOO", play.SILENCE)], play.STOPPING
    )
    await driver.status()
    await driver.stop()


async def test_a_lost_status_connection_is_reopened(play) -> None:
    driver = await play.opened([], [*LOOKING_ON, ("get machine", play.HANG_UP)], [*LOOKING_ON, *asked()])
    with pytest.raises(DeviceError, match="closed the connection"):
        await driver.status()
    assert await driver.status() == ON


async def test_the_status_is_not_read_during_a_stop(play) -> None:
    at_rest = play.Pause()
    stopping = [*play.STOPPING[:-1], ("get joint_pos", at_rest, play.AT_REST)]
    driver = await play.opened([], stopping, [*LOOKING_ON, *asked()])
    stop = asyncio.create_task(driver.stop())
    await asyncio.sleep(0)
    looking = await at_rest.reached_by(driver.status())
    assert play.servers[0].connections == 2
    at_rest.set()
    await stop
    assert await looking == ON


@pytest.mark.parametrize(
    ("answer", "then", "told"),
    [
        (wire.ACK, [("get abs_act_pos", wire.HALF_WAY)], "it was stopped on request"),
        (wire.NAK, wire.said("get enable: OFF"), "was stopped before it moved"),
    ],
)
async def test_a_stop_during_a_move_is_reported_by_the_move(play, answer, then, told) -> None:
    """The move raises its own error, also where it is refused; the guards need no second stop."""
    stopped = play.Pause()
    main = [(wire.MDI, stopped, answer), *then]
    driver = await play.opened(main, [*LOOKING_ON, *asked(), wire.AGAIN_IN_CONTROL, *play.STOPPED])
    await driver.status()
    moving = await stopped.reached_by(driver.move(wire.TARGET, wire.MOVE_S))
    await driver.stop()
    stopped.set()
    with pytest.raises(MotionInterrupted, match=told):
        await moving
