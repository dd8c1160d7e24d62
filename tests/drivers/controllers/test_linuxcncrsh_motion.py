"""Moving and stopping: what is acknowledged is not yet true, and what comes late is not for us."""

from __future__ import annotations

import asyncio
import time

import pytest

from drivers.controllers.errors import AnswerOverdue, ConnectionLost, MotionInterrupted, MoveRefused
from hexacell.errors import DeviceError
from hexacell.pose import Pose

TARGET = Pose(10.0, 20.0, 560.0, 5.0, -4.0, 3.0)
MDI = "set mdi G0 X10.00000000 Y20.00000000 Z560.00000000 A5.00000000 B-4.00000000 C3.00000000"
ACK = b"SET MDI ACK\n\r"
ARRIVED = b"ABS_ACT_POS 10.000000 20.000000 560.000000 5.000000 -4.000000 3.000000\r\n"
HALF_WAY = b"ABS_ACT_POS 5.000000 10.000000 555.000000 2.500000 -2.000000 1.500000\r\n"
NO_ERROR = ("get error", b"ERROR OK\r\n")
AGAIN_IN_CONTROL = ("set enable EMCTOO", b"SET ENABLE ACK\n\r")


async def test_a_move_and_its_arrival(play):
    driver = await play.opened([(MDI, ACK), ("get abs_act_pos", ARRIVED)])
    await driver.move(TARGET)


async def test_the_position_may_take_a_moment_to_agree(play):
    nearly = b"ABS_ACT_POS 10.000000 20.000000 559.980000 5.000000 -4.000000 3.000000\r\n"
    within = b"ABS_ACT_POS 10.009000 20.000000 560.000000 5.009000 -4.000000 363.000000\r\n"
    driver = await play.opened(
        [(MDI, ACK), *[("get abs_act_pos", nearly)] * 2, ("get abs_act_pos", within)]
    )
    await driver.move(TARGET)


@pytest.mark.parametrize(
    "elsewhere",
    [
        b"ABS_ACT_POS 10.000000 20.011000 560.000000 5.000000 -4.000000 3.000000\r\n",
        b"ABS_ACT_POS 10.000000 20.000000 560.000000 5.000000 -4.011000 3.000000\r\n",
    ],
)
async def test_an_acknowledgement_is_not_an_arrival(play, elsewhere):
    play.patience = play.IMPATIENT
    driver = await play.opened([(MDI, ACK)])
    play.servers[0].afterwards = {
        "get abs_act_pos": elsewhere,
        "get error": [b"ERROR joint 2 following error\r\n", b"ERROR OK\r\n"],
    }
    with pytest.raises(MotionInterrupted, match=r"on the way to X10\.000 Y20\.000 Z560") as caught:
        await driver.move(TARGET)
    assert "joint 2 following error" in caught.value.problem


@pytest.mark.parametrize(
    ("estop", "machine", "why"),
    [
        (b"ESTOP ON\r\n", b"MACHINE OFF\r\n", "it is in emergency stop"),
        (b"ESTOP OFF\r\n", b"MACHINE OFF\r\n", "it is switched off"),
        (b"ESTOP OFF\r\n", b"MACHINE ON\r\n", "it is on, and gives no reason"),
    ],
)
async def test_a_move_that_ends_elsewhere_without_a_word(play, estop, machine, why):
    play.patience = play.IMPATIENT
    driver = await play.opened([(MDI, ACK)])
    play.servers[0].afterwards = {
        "get abs_act_pos": HALF_WAY,
        "get error": b"ERROR OK\r\n",
        "get estop": estop,
        "get machine": machine,
    }
    with pytest.raises(MotionInterrupted, match=f"stopped at X5.000 Y10.000 Z555.000 .*: {why}"):
        await driver.move(TARGET)


async def test_a_refused_move_tells_all_errors_and_leaves_none_behind(play):
    driver = await play.opened(
        [
            (MDI, b"SET MDI NAK\n\r"),
            ("get enable", b"ENABLE ON\r\n"),
            ("get error", b"ERROR Linear move on line 0 fails kinematicsInverse\r\n"),
            ("get error", b"ERROR invalid params in linear command\r\n"),
            NO_ERROR,
            (MDI, ACK),
            ("get abs_act_pos", ARRIVED),
        ]
    )
    with pytest.raises(MoveRefused) as caught:
        await driver.move(TARGET)
    assert caught.value.problem == (
        "refuses to move to X10.000 Y20.000 Z560.000 A5.000 B-4.000 C3.000: "
        "Linear move on line 0 fails kinematicsInverse; invalid params in linear command"
    )
    await driver.move(TARGET)


async def test_a_controller_that_never_stops_complaining_does_not_hold_us_up(play):
    driver = await play.opened([(MDI, b"SET MDI NAK\n\r")])
    play.servers[0].afterwards = {
        "get enable": b"ENABLE ON\r\n",
        "get error": b"ERROR emc_error: bad status from EMC\r\n",
    }
    with pytest.raises(MoveRefused, match=r": emc_error: bad status from EMC$"):
        await driver.move(TARGET)


async def test_control_that_another_client_took_is_not_taken_back_unasked(play):
    driver = await play.opened(
        [
            (MDI, b"SET MDI NAK\n\r"),
            ("get enable", b"ENABLE OFF\r\n"),
            (MDI, b"SET MDI NAK\n\r"),
            ("get enable", b"ENABLE OFF\r\n"),
        ]
    )
    for _ in range(2):
        with pytest.raises(MoveRefused, match=r"another client has taken control of it\. See that nobody"):
            await driver.move(TARGET)


async def test_a_pose_that_is_none_is_not_sent(play):
    driver = await play.opened([])
    with pytest.raises(MoveRefused, match="a coordinate is not a finite number"):
        await driver.move(Pose(float("nan"), 0, 0))


async def test_a_move_that_takes_too_long_is_stopped_and_its_late_answer_is_not_mistaken(play):
    stopped = asyncio.Event()
    driver = await play.opened(
        [
            (MDI, stopped, ACK),
            AGAIN_IN_CONTROL,
            ("get joint_pos", b"JOINT_POS 1 2 3 4 5 6\r\n"),
        ],
        [*play.GREETING, ("set abort", b"SET ABORT ACK\n\r"), *play.STOPPING[-3:]],
        move_timeout_s=0.03,
    )
    with pytest.raises(MotionInterrupted, match=r"still moving after 0\.03 s and was stopped"):
        await driver.move(TARGET)
    stopped.set()
    assert await driver.joint_positions() == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


async def test_a_line_that_breaks_in_mid_move_stops_the_machine(play):
    driver = await play.opened([(MDI, play.HANG_UP)], play.STOPPING)
    with pytest.raises(ConnectionLost, match="closed the connection"):
        await driver.move(TARGET)


async def test_a_controller_that_dies_in_mid_move_asks_for_the_emergency_stop(play):
    driver = await play.opened([(MDI, play.HANG_UP)], *[[("hello EMC hexacell 1.0", play.HANG_UP)]] * 3)
    with pytest.raises(
        DeviceError, match=r"could not be stopped: it closed the connection\. Press the emer"
    ):
        await driver.move(TARGET)


async def test_stopping_goes_over_a_second_connection_while_the_first_is_mute(play):
    aborted = asyncio.Event()
    driver = await play.opened(
        [
            (MDI, aborted, ACK),
            ("get abs_act_pos", HALF_WAY),
            AGAIN_IN_CONTROL,
            (MDI, ACK),
            ("get abs_act_pos", ARRIVED),
        ],
        [*play.GREETING, ("set abort", b"SET ABORT ACK\n\r"), *[("get abs_act_pos", HALF_WAY)] * 3],
    )
    moving = asyncio.create_task(driver.move(TARGET))
    await asyncio.sleep(0.01)
    await driver.stop()
    aborted.set()
    with pytest.raises(MotionInterrupted, match=r"stopped at X5\.000 .*: it was told to"):
        await moving
    await driver.move(TARGET)


async def test_one_client_is_silent_while_the_other_speaks(play):
    """LinuxCNC 2.9 garbles commands of two clients that coincide."""
    speak = asyncio.Event()
    driver = await play.opened(
        [(MDI, ACK), ("get abs_act_pos", HALF_WAY)],
        [*play.GREETING, ("set abort", speak, b"SET ABORT ACK\n\r"), *play.STOPPING[-3:]],
    )
    moving = asyncio.create_task(driver.move(TARGET))
    await asyncio.sleep(0)
    stopping = asyncio.create_task(driver.stop())
    await asyncio.sleep(0.05)
    silent_so_far = not moving.done()
    speak.set()
    await stopping
    with pytest.raises(MotionInterrupted):
        await moving
    assert silent_so_far


async def test_stopping_aborts_again_while_it_still_moves(play):
    moving = [b"ABS_ACT_POS %d 0 0 0 0 0\r\n" % n for n in range(1, 4)]
    driver = await play.opened(
        [],
        [
            *play.GREETING,
            ("set abort", b"SET ABORT ACK\n\r"),
            ("get abs_act_pos", moving[0]),
            ("get abs_act_pos", moving[1]),
            AGAIN_IN_CONTROL,
            ("set abort", b"SET ABORT ACK\n\r"),
            ("get abs_act_pos", moving[2]),
            ("get abs_act_pos", moving[2]),
            ("get abs_act_pos", moving[2]),
        ],
    )
    await driver.stop()


async def test_a_machine_that_is_off_refuses_to_abort_and_stands(play):
    driver = await play.opened(
        [], [*play.GREETING, ("set abort", b"SET ABORT NAK\n\r"), *[("get abs_act_pos", play.AT_REST)] * 3]
    )
    await driver.stop()


async def test_a_machine_that_does_not_stop(play):
    play.patience = play.IMPATIENT
    driver = await play.opened([], play.GREETING)
    play.servers[0].afterwards = {
        "set enable EMCTOO": b"SET ENABLE ACK\n\r",
        "set abort": b"SET ABORT ACK\n\r",
        "get abs_act_pos": [f"ABS_ACT_POS {n} 0 0 0 0 0\r\n".encode() for n in range(100_000)],
    }
    with pytest.raises(DeviceError, match=r"does not stand still 0\.6 s after .*Press the emergency stop"):
        await driver.stop()


async def test_stopping_tries_again_what_another_clients_command_garbled(play):
    driver = await play.opened([], [("hello EMC hexacell 1.0", b"HELLO NAK\r\n")], play.STOPPING)
    await driver.stop()


async def test_stopping_without_a_connection_works_all_the_same(play):
    driver = await play.driver(play.STOPPING)
    await driver.stop()


async def test_two_stops_at_once_do_not_disturb_each_other(play):
    speak = asyncio.Event()
    first = [*play.GREETING, ("set abort", speak, b"SET ABORT ACK\n\r"), *play.STOPPING[-3:]]
    driver = await play.opened([], first, play.STOPPING)
    stopping = [asyncio.create_task(driver.stop()) for _ in range(2)]
    await asyncio.sleep(0.03)
    connections_so_far = play.servers[0].connections
    speak.set()
    await asyncio.gather(*stopping)
    assert connections_so_far == 2


async def test_nothing_is_connected_to_again_while_a_stop_is_under_way(play):
    speak = asyncio.Event()
    joints = ("get joint_pos", b"JOINT_POS 1 2 3 4 5 6\r\n")
    driver = await play.opened(
        [(*joints, play.HANG_UP)],
        [*play.GREETING, ("set abort", speak, b"SET ABORT ACK\n\r"), *play.STOPPING[-3:]],
        [*play.OPENING[:-1], joints],
    )
    await driver.joint_positions()
    stopping = asyncio.create_task(driver.stop())
    asking = asyncio.create_task(driver.joint_positions())
    await asyncio.sleep(0.03)
    connections_so_far = play.servers[0].connections
    speak.set()
    await asyncio.gather(stopping, asking)
    assert connections_so_far == 2


async def test_a_move_that_waits_for_its_turn_is_not_begun_after_a_stop(play):
    answer = asyncio.Event()
    driver = await play.opened(
        [("get joint_pos", answer, b"JOINT_POS 1 2 3 4 5 6\r\n"), AGAIN_IN_CONTROL], play.STOPPING
    )
    asking = asyncio.create_task(driver.joint_positions())
    moving = asyncio.create_task(driver.move(TARGET))
    await asyncio.sleep(0.01)
    stopping = asyncio.create_task(driver.stop())
    await asyncio.sleep(0.01)
    answer.set()
    await asking
    with pytest.raises(MotionInterrupted, match="was stopped before it moved"):
        await moving
    await stopping


async def test_a_cancelled_move_is_stopped_and_its_late_answer_is_not_mistaken(play):
    aborted = asyncio.Event()
    driver = await play.opened(
        [(MDI, aborted, ACK), AGAIN_IN_CONTROL, (MDI, ACK), ("get abs_act_pos", ARRIVED)],
        play.STOPPING,
    )
    moving = asyncio.create_task(driver.move(TARGET))
    await asyncio.sleep(0.01)
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    aborted.set()
    await driver.move(TARGET)


async def test_a_cancelled_move_stays_cancelled_though_it_cannot_be_stopped(play):
    never = asyncio.Event()
    driver = await play.opened([(MDI, never)], *[[("hello EMC hexacell 1.0", play.HANG_UP)]] * 3)
    moving = asyncio.create_task(driver.move(TARGET))
    await asyncio.sleep(0.01)
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving


async def test_a_move_cancelled_before_its_turn_stops_nothing(play):
    answer = asyncio.Event()
    driver = await play.opened([("get joint_pos", answer, b"JOINT_POS 1 2 3 4 5 6\r\n")])
    asking = asyncio.create_task(driver.joint_positions())
    await asyncio.sleep(0)
    moving = asyncio.create_task(driver.move(TARGET))
    await asyncio.sleep(0.01)
    moving.cancel()
    answer.set()
    assert await asking == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    with pytest.raises(asyncio.CancelledError):
        await moving


async def test_a_cancelled_question_leaves_the_line_in_step(play):
    late = asyncio.Event()
    driver = await play.opened(
        [
            ("get joint_pos", late, b"JOINT_POS 1 2 3 4 5 6\r\n"),
            ("get joint_pos", b"JOINT_POS 6 5 4 3 2 1\r\n"),
        ]
    )
    asking = asyncio.create_task(driver.joint_positions())
    await asyncio.sleep(0.01)
    asking.cancel()
    with pytest.raises(asyncio.CancelledError):
        await asking
    late.set()
    assert await driver.joint_positions() == (6.0, 5.0, 4.0, 3.0, 2.0, 1.0)


async def test_an_overdue_answer_leaves_the_line_in_step(play):
    play.patience = play.IMPATIENT
    late = asyncio.Event()
    driver = await play.opened(
        [("get abs_act_pos", late, ARRIVED), ("get abs_act_pos", HALF_WAY)],
    )
    with pytest.raises(AnswerOverdue, match=r"did not answer 'get abs_act_pos' within 0\.4 s"):
        await driver.pose()
    late.set()
    assert (await driver.pose()).x == 5.0


async def test_an_answer_that_never_comes_costs_the_connection(play):
    play.patience = play.IMPATIENT
    driver = await play.opened(
        [("get abs_act_pos", play.SILENCE)], [*play.OPENING[:-1], ("get abs_act_pos", HALF_WAY)]
    )
    with pytest.raises(AnswerOverdue):
        await driver.pose()
    assert (await driver.pose()).x == 5.0


async def test_a_server_that_was_started_anew_is_connected_to_again(play):
    driver = await play.opened(
        [("get abs_act_pos", ARRIVED, play.HANG_UP)],
        [*play.OPENING[:-1], ("get abs_act_pos", HALF_WAY)],
    )
    assert (await driver.pose()).x == 10.0
    await asyncio.sleep(0.02)
    assert (await driver.pose()).x == 5.0


async def test_a_garbled_question_is_asked_again_and_an_order_is_not(play):
    driver = await play.opened(
        [
            ("get joint_pos", b"GET EMCTOO NAK\r\n\r\nGET JOINT_POS NAK\r\n\r\n"),
            ("get joint_pos", b"JOINT_POS 1 2 3 4 5 6\r\n"),
            (MDI, b"SET NAK\r\n"),
            ("get enable", b"ENABLE ON\r\n"),
            ("get error", b"ERROR No characters found in reading real value\r\n"),
            NO_ERROR,
        ]
    )
    assert await driver.joint_positions() == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    with pytest.raises(MoveRefused):
        await driver.move(TARGET)


async def test_closing_while_an_answer_is_awaited(play):
    driver = await play.opened([("get joint_pos", play.SILENCE)])
    asking = asyncio.create_task(driver.joint_positions())
    await asyncio.sleep(0.01)
    begun = time.monotonic()
    await driver.close()
    with pytest.raises(DeviceError):
        await asking
    assert time.monotonic() - begun < 0.1
