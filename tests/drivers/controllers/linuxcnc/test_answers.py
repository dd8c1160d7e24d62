"""Answers that are late, double, garbled or unknown are never taken for those to the next query."""

import pytest

from drivers.errors import CommandRefused, ConnectionLost, MoveRefused, ResponseTimeout
from hexacell.errors import DeviceError
from tests.drivers.controllers.linuxcnc.conftest import ALL, MOVE_S, TARGET, Then, once

NOT_SO = b"JOINT_POS 1 2 3 4 5 6\r\n"


async def test_an_answer_that_comes_twice_is_not_that_to_the_next_query(ready, controller) -> None:
    before = await ready.joints_now()
    controller.says["get joint_pos"] = once(2 * NOT_SO)
    assert await ready.joints_now() == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert await ready.joints_now() == before


async def test_an_answer_that_does_not_come_ends_the_link(ready, controller) -> None:
    controller.says["get joint_pos"] = once(Then.SAY_NOTHING)
    with pytest.raises(ResponseTimeout, match=r"did not answer 'get joint_pos' within 0\.5 s"):
        await ready.status()
    with pytest.raises(ConnectionLost):
        await ready.move(TARGET, MOVE_S)
    await ready.prepare(ALL)
    await ready.move(TARGET, MOVE_S)


async def test_a_garbled_query_is_repeated_and_a_garbled_command_is_not(ready, controller) -> None:
    before = await ready.joints_now()
    controller.says["get joint_pos"] = once(b"GET EMCTOO NAK\r\n\r\nGET JOINT_POS NAK\r\n\r\n")
    assert await ready.joints_now() == before
    controller.says["set mdi"] = once(b"SET NAK\r\n")
    with pytest.raises(DeviceError, match="it is on, and gives no reason"):
        await ready.move(TARGET, MOVE_S)
    assert controller.count("set mdi G21") == 1
    controller.says["get joint_pos"] = b"GET JOINT_POS NAK\r\n"
    with pytest.raises(CommandRefused, match="does not know 'get joint_pos'"):
        await ready.status()


@pytest.mark.parametrize("said", [b"JOINT_POS 1 2 3\r\n", b"JOINT_POS 1 2 3 4 5 nan\r\n", b"JOINT_POS\r\n"])
async def test_joints_that_are_none_are_no_joints(ready, controller, said) -> None:
    controller.says["get joint_pos"] = said
    with pytest.raises(DeviceError, match="it reports '"):
        await ready.joints_now()


async def test_a_controller_that_was_ended_must_be_prepared_again(ready, controller) -> None:
    controller._cut_all()
    with pytest.raises(ConnectionLost, match="closed the connection: it was ended or restarted"):
        await ready.status()
    with pytest.raises((ConnectionLost, MoveRefused)):
        await ready.move(TARGET, MOVE_S)
    await ready.prepare(ALL)
    await ready.move(TARGET, MOVE_S)


async def test_status_has_the_messages_that_an_order_read_and_an_order_those_of_the_status(
    ready, controller
) -> None:
    """LinuxCNC gives a message once."""
    controller.state.exceed_following_error()
    for _ in range(2):
        status = await ready.status()
        assert (status.enabled, status.error_messages) == (False, ("joint 3 following error",))
    with pytest.raises(MoveRefused, match="switched off"):
        await ready.move(TARGET, MOVE_S)
    assert (await ready.status()).error_messages == ("joint 3 following error",)
    await ready.prepare(ALL)
    assert (await ready.status()).error_messages == ()


async def test_messages_of_before_are_not_those_of_this_client(make, controller) -> None:
    controller.state._errors.append("left over from somebody else")
    driver = make()
    await driver.open()
    assert (await driver.status()).error_messages == ()
