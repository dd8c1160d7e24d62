"""Answers that are cancelled, late, garbled or cut off are never taken for that to the next query."""

import asyncio

import pytest

from drivers.controllers.linuxcnc.protocol import Timeouts
from drivers.errors import MoveRefused, ResponseTimeout
from hexacell.errors import DeviceError
from tests.drivers.controllers.linuxcnc.conftest import (
    ACK,
    AGAIN_IN_CONTROL,
    ARRIVED,
    HALF_WAY,
    JOINTS,
    MDI,
    MOVE_S,
    RESTORED,
    TARGET,
    said,
)
from tests.linuxcnc_orders import joints_of, pose_of
from tests.waiting import cancel, until


async def test_a_cancelled_move_is_stopped_and_its_late_answer_is_discarded(play):
    aborted = play.Pause()
    driver = await play.opened(
        [(MDI, aborted, ACK), AGAIN_IN_CONTROL, (MDI, ACK), ("get abs_act_pos", ARRIVED), RESTORED],
        play.STOPPING,
    )
    await cancel(await aborted.reached_by(driver.move(TARGET, MOVE_S)))
    aborted.set()
    await driver.move(TARGET, MOVE_S)


async def test_a_cancelled_move_raises_the_cancellation_even_if_the_stop_fails(play):
    never = play.Pause()
    driver = await play.opened([(MDI, never)], *[[("hello EMC hexacell 1.0", play.HANG_UP)]] * 3)
    await cancel(await never.reached_by(driver.move(TARGET, MOVE_S)))


async def test_a_move_cancelled_before_its_turn_stops_nothing(play):
    answer = play.Pause()
    driver = await play.opened([("get joint_pos", answer, b"JOINT_POS 1 2 3 4 5 6\r\n")])
    asking = asyncio.create_task(joints_of(driver))
    await asyncio.sleep(0)
    moving = await answer.reached_by(driver.move(TARGET, MOVE_S))
    moving.cancel()
    answer.set()
    assert await asking == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    with pytest.raises(asyncio.CancelledError):
        await moving


async def test_the_late_answer_to_a_cancelled_query_is_discarded(play):
    late = play.Pause()
    driver = await play.opened(
        [
            ("get joint_pos", late, b"JOINT_POS 1 2 3 4 5 6\r\n"),
            ("get joint_pos", b"JOINT_POS 6 5 4 3 2 1\r\n"),
        ]
    )
    await cancel(await late.reached_by(joints_of(driver)))
    late.set()
    assert await joints_of(driver) == (6.0, 5.0, 4.0, 3.0, 2.0, 1.0)


async def test_an_answer_after_its_timeout_is_discarded(play):
    play.patience = play.IMPATIENT
    late = play.Pause()
    driver = await play.opened([("get abs_act_pos", late, ARRIVED), ("get abs_act_pos", HALF_WAY)])
    with pytest.raises(ResponseTimeout, match=r"did not answer 'get abs_act_pos' within 0\.4 s"):
        await pose_of(driver)
    late.set()
    assert (await pose_of(driver)).x == 5.0


async def test_an_answer_that_comes_twice_is_not_that_to_the_next_query(play):
    driver = await play.opened([("get joint_pos", 2 * b"JOINT_POS 6 5 4 3 2 1\r\n"), JOINTS])
    assert await joints_of(driver) == (6.0, 5.0, 4.0, 3.0, 2.0, 1.0)
    assert await joints_of(driver) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


async def test_a_server_that_was_started_anew_is_connected_to_again(play):
    driver = await play.opened(
        [("get abs_act_pos", ARRIVED, play.HANG_UP)], [*play.OPENING[:-1], ("get abs_act_pos", HALF_WAY)]
    )
    assert (await pose_of(driver)).x == 10.0
    await until(driver._session._channel.commands.connection.reader.at_eof)
    assert (await pose_of(driver)).x == 5.0


async def test_a_garbled_query_is_repeated_and_a_garbled_command_is_not(play):
    driver = await play.opened(
        [
            ("get joint_pos", b"GET EMCTOO NAK\r\n\r\nGET JOINT_POS NAK\r\n\r\n"),
            JOINTS,
            (MDI, b"SET NAK\r\n"),
            *said("get enable: ON | get error: No characters found in reading real value | get error: OK"),
        ]
    )
    assert await joints_of(driver) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    with pytest.raises(MoveRefused):
        await driver.move(TARGET, MOVE_S)


async def test_closing_ends_a_query_in_progress(play):
    play.patience = Timeouts(answer=3600.0)
    never = play.Pause()
    driver = await play.opened([("get joint_pos", never)])
    asking = await never.reached_by(joints_of(driver))
    await driver.close()
    with pytest.raises(DeviceError):
        await asking
