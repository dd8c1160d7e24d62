"""The status of the machine, read over a second connection while the first one waits for a move."""

from __future__ import annotations

import asyncio

import pytest

from drivers.controllers.linuxcnc.connection import PARSED_S, SendArbiter
from drivers.errors import MotionInterrupted, MoveRefused
from drivers.interfaces import ControllerStatus, StartupAction
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

GREETING = [
    ("hello EMC hexacell 1.0", b"HELLO ACK EMCNETSVR 1.1\r\n"),
    ("set echo off", b"set echo off\r\n"),
    ("set verbose on", b"SET VERBOSE ACK\n\r"),
]
"""Whoever only looks on does not take control."""


JOINTS = "1.000000 2.000000 3.000000 4.000000 5.000000 6.000000"


def asked(*, estop: str = "OFF", machine: str = "ON") -> list[tuple[str, bytes]]:
    return [
        ("get machine", f"MACHINE {machine}\r\n".encode()),
        ("get estop", f"ESTOP {estop}\r\n".encode()),
        ("get joint_pos", f"JOINT_POS {JOINTS}\r\n".encode()),
    ]


ON = ControllerStatus(estop=False, enabled=True, heartbeat=JOINTS)
ERROR_OK = ("get error", b"ERROR OK\r\n")


async def test_an_emergency_stop_while_the_status_is_read_is_told_as_one(play) -> None:
    driver = await play.opened([], [*GREETING, *asked(machine="ON", estop="ON")])
    assert (await driver.status()).estop


async def test_the_status_is_read_without_taking_control(play) -> None:
    driver = await play.opened([], [*GREETING, *asked(), *asked()])
    assert await driver.status() == ON
    assert await driver.status() == ON
    assert play.servers[0].connections == 2


async def test_error_messages_are_read_when_the_machine_switches_off(play) -> None:
    off = asked(estop="OFF", machine="OFF")
    lagging = ("get error", b"ERROR joint 3 following error\r\n")
    driver = await play.opened([], [*GREETING, *asked(), *off, lagging, ERROR_OK, *off, ERROR_OK])
    assert await driver.status() == ON
    for _ in range(2):
        status = await driver.status()
        assert status == ControllerStatus(False, False, ("joint 3 following error",), JOINTS)
        assert not status.may_move


FAULT = ("get error", b"ERROR joint 3 following error\r\n")
MOVE_S = 3.0
BLOCK = (
    "set mdi G21 G53 G93 G1 X1.00000000 Y2.00000000 Z3.00000000 "
    "A0.00000000 B0.00000000 C0.00000000 F20.00000000"
)
RESTORED = ("set mdi G94 G0", b"SET MDI ACK\n\r")


async def test_status_has_the_messages_that_the_order_is_reading(play) -> None:
    """LinuxCNC gives a message once; here the command's connection gets it and is still reading."""
    reading = play.Pause()
    main = [
        (BLOCK, b"SET MDI NAK\n\r"),
        ("get enable", b"ENABLE ON\r\n"),
        FAULT,
        ("get error", reading, b"ERROR OK\r\n"),
    ]
    off = asked(machine="OFF")
    driver = await play.opened(main, [*GREETING, *asked(), *off, ERROR_OK])
    await driver.status()
    moving = asyncio.create_task(driver.move(Pose(1.0, 2.0, 3.0), MOVE_S))
    await reading.reached.wait()
    status = asyncio.create_task(driver.status())
    reading.set()
    assert (await status).error_messages == ("joint 3 following error",)
    with pytest.raises(MoveRefused, match="joint 3 following error"):
        await moving


async def test_an_order_has_the_messages_that_the_status_read(play) -> None:
    refused = play.Pause()
    main = [(BLOCK, refused, b"SET MDI NAK\n\r"), ("get enable", b"ENABLE ON\r\n"), ERROR_OK]
    driver = await play.opened(main, [*GREETING, *asked(), *asked(machine="OFF"), FAULT, ERROR_OK])
    await driver.status()
    moving = asyncio.create_task(driver.move(Pose(1.0, 2.0, 3.0), MOVE_S))
    await refused.reached.wait()
    assert (await driver.status()).error_messages == ("joint 3 following error",)
    refused.set()
    with pytest.raises(MoveRefused, match="joint 3 following error"):
        await moving


async def test_a_message_whose_reading_is_cancelled_is_kept(play) -> None:
    reading = play.Pause()
    off = asked(machine="OFF")
    message = ("get error", reading, b"ERROR joint 3 following error\r\n")
    driver = await play.opened([], [*GREETING, *asked(), *off, message, ERROR_OK, *off, ERROR_OK])
    await driver.status()
    cancelled = asyncio.create_task(driver.status())
    await reading.reached.wait()
    cancelled.cancel()
    reading.set()
    with pytest.raises(asyncio.CancelledError):
        await cancelled
    assert (await driver.status()).error_messages == ("joint 3 following error",)


async def test_error_messages_are_read_if_the_machine_switches_off_between_prepare_and_the_first_status(
    play,
) -> None:
    preparation = [
        ("set enable EMCTOO", b"SET ENABLE ACK\n\r"),
        ("get error", b"ERROR left over from before\r\n"),
        ERROR_OK,
        ("set set_wait done", b"SET SET_WAIT ACK\n\r"),
        ("get estop", b"ESTOP OFF\r\n"),
        ("get machine", b"MACHINE OFF\r\n"),
        ("set machine on", b"SET MACHINE ACK\n\r"),
        ("get machine", b"MACHINE ON\r\n"),
        ("get estop", b"ESTOP OFF\r\n"),
        ("get machine", b"MACHINE ON\r\n"),
        ("get joint_homed", b"JOINT_HOMED YES YES YES YES YES YES\r\n"),
        ("set mode mdi", b"SET MODE ACK\n\r"),
        ("get mode", b"MODE MDI\r\n"),
        ("get user_linear_units", b"USER_LINEAR_UNITS MM\r\n"),
        ("get program_codes", b"PROGRAM_CODES G21 G90\r\n"),
        ("get pos_offset", b"POS_OFFSET 0.0 0.0 0.0 0.0 0.0 0.0\r\n"),
        ("get feed_override", b"FEED_OVERRIDE 100\r\n"),
    ]
    driver = await play.opened(preparation, [*GREETING, *asked(machine="OFF"), FAULT, ERROR_OK])
    await driver.prepare(frozenset({StartupAction.SWITCH_ON}))
    assert (await driver.status()).error_messages == ("joint 3 following error",)


async def test_the_status_is_read_during_a_move(play) -> None:
    arrived = play.Pause()
    there = b"ABS_ACT_POS 1.000000 2.000000 3.000000 0.000000 0.000000 0.000000\r\n"
    main = [(BLOCK, arrived, b"SET MDI ACK\n\r"), ("get abs_act_pos", there), RESTORED]
    driver = await play.opened(main, [*GREETING, *asked()])
    moving = asyncio.create_task(driver.move(Pose(1.0, 2.0, 3.0), MOVE_S))
    await arrived.reached.wait()
    assert await driver.status() == ON
    assert not moving.done()
    arrived.set()
    await moving


async def test_stopping_uses_the_status_connection(play) -> None:
    stopping = [("set enable EMCTOO", b"SET ENABLE ACK\n\r"), ("set abort", b"SET ABORT ACK\n\r")]
    still = [("get joint_pos", play.AT_REST)] * 3
    driver = await play.opened([], [*GREETING, *asked(), *stopping, *still])
    await driver.status()
    await driver.stop()
    assert play.servers[0].connections == 2, "no time is lost on opening a third one"


async def test_stopping_works_if_the_status_connection_does_not_answer(play) -> None:
    driver = await play.opened(
        [], [*GREETING, *asked(), ("set enable EMCTOO", play.SILENCE)], play.STOPPING
    )
    await driver.status()
    await driver.stop()


async def test_a_lost_status_connection_is_reopened(play) -> None:
    driver = await play.opened([], [*GREETING, ("get machine", play.HANG_UP)], [*GREETING, *asked()])
    with pytest.raises(DeviceError, match="closed the connection"):
        await driver.status()
    assert await driver.status() == ON


async def test_the_status_is_not_read_during_a_stop(play) -> None:
    at_rest = play.Pause()
    stopping = [*play.STOPPING[:-1], ("get joint_pos", at_rest, play.AT_REST)]
    driver = await play.opened([], stopping, [*GREETING, *asked()])
    stop = asyncio.create_task(driver.stop())
    await asyncio.sleep(0)
    looking = asyncio.create_task(driver.status())
    await at_rest.reached.wait()
    assert play.servers[0].connections == 2
    at_rest.set()
    await stop
    assert await looking == ON


async def test_commands_are_not_sent_at_once_but_a_query_is_sent_while_a_long_command_runs() -> None:
    arbiter = SendArbiter()
    said: list[str] = []
    asked = asyncio.Event()

    async def order() -> None:
        async with arbiter.query_turn():
            said.append("order")
            await asked.wait()
            said.append("order done")

    async def question() -> None:
        async with arbiter.query_turn():
            said.append("question")
            asked.set()

    await asyncio.gather(order(), question())
    assert said == ["order", "question", "order done"]


async def test_queries_wait_until_an_exclusive_turn_ends() -> None:
    arbiter = SendArbiter()
    said: list[str] = []

    async def opening() -> None:
        async with arbiter.line:
            await asyncio.sleep(3 * PARSED_S)
            said.append("opened")

    async def question() -> None:
        async with arbiter.query_turn():
            said.append("question")

    await asyncio.gather(opening(), question())
    assert said == ["opened", "question"]


AT_HOME = b"ABS_ACT_POS 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000\r\n"


async def test_a_stop_during_a_move_is_reported_by_the_move(play) -> None:
    """The move raises its own error; the guards need no second stop."""
    stopped = play.Pause()
    main = [(BLOCK, stopped, b"SET MDI ACK\n\r"), ("get abs_act_pos", AT_HOME)]
    driver = await play.opened(
        main,
        [
            *GREETING,
            *asked(),
            ("set enable EMCTOO", b"SET ENABLE ACK\n\r"),
            ("set abort", b"SET ABORT ACK\n\r"),
            *[("get joint_pos", play.AT_REST)] * 3,
        ],
    )
    await driver.status()
    moving = asyncio.create_task(driver.move(Pose(1.0, 2.0, 3.0), MOVE_S))
    await stopped.reached.wait()
    await driver.stop()
    stopped.set()
    with pytest.raises(MotionInterrupted, match="it was stopped on request"):
        await moving


async def test_a_move_that_is_refused_because_a_stop_took_control_was_stopped(play) -> None:
    received = play.Pause()
    main = [(BLOCK, received, b"SET MDI NAK\n\r"), ("get enable", b"ENABLE OFF\r\n")]
    stopping = [("set enable EMCTOO", b"SET ENABLE ACK\n\r"), ("set abort", b"SET ABORT ACK\n\r")]
    driver = await play.opened(
        main, [*GREETING, *asked(), *stopping, *[("get joint_pos", play.AT_REST)] * 3]
    )
    await driver.status()
    moving = asyncio.create_task(driver.move(Pose(1.0, 2.0, 3.0), MOVE_S))
    await received.reached.wait()
    await driver.stop()
    received.set()
    with pytest.raises(MotionInterrupted, match="was stopped before it moved"):
        await moving
