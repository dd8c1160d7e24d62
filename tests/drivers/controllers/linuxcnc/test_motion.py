"""Moves: arrival is verified by the position, and a refusal is reported with its reason."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import CommandRefused, ConnectionLost, MotionInterrupted, MoveRefused, PoseRefused
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from tests.drivers.controllers.linuxcnc import conftest as wire
from tests.linuxcnc_orders import joints_of


async def test_a_move_returns_when_the_position_is_within_tolerance(play):
    nearly = b"ABS_ACT_POS 10.000000 20.000000 559.980000 5.000000 -4.000000 3.000000\r\n"
    within = b"ABS_ACT_POS 10.009000 20.000000 560.000000 5.009000 -4.000000 363.000000\r\n"
    driver = await play.opened(
        [
            (wire.MDI, wire.ACK),
            *[("get abs_act_pos", nearly)] * 2,
            ("get abs_act_pos", within),
            wire.RESTORED,
        ]
    )
    await driver.move(wire.TARGET, wire.MOVE_S)


async def test_a_move_that_is_acknowledged_before_its_end_is_waited_for(play):
    """As LinuxCNC does on a computer under load; it moves far longer than a stop is waited for."""
    play.patience = play.IMPATIENT
    polls = 3 * int(play.IMPATIENT.arrival / play.IMPATIENT.poll)
    heights = np.linspace(500.0, 560.0, polls, endpoint=False)
    on_the_way = [
        ("get abs_act_pos", b"ABS_ACT_POS 10.0 20.0 %.6f 5.0 -4.0 3.0\r\n" % height) for height in heights
    ]
    driver = await play.opened(
        [(wire.MDI, wire.ACK), *on_the_way, ("get abs_act_pos", wire.ARRIVED), wire.RESTORED]
    )
    await driver.move(wire.TARGET, wire.MOVE_S)


@pytest.mark.parametrize(
    "elsewhere",
    [
        b"ABS_ACT_POS 10.000000 20.011000 560.000000 5.000000 -4.000000 3.000000\r\n",
        b"ABS_ACT_POS 10.000000 20.000000 560.000000 5.000000 -4.011000 3.000000\r\n",
    ],
)
async def test_an_acknowledgement_is_not_an_arrival(play, elsewhere):
    play.patience = play.IMPATIENT
    driver = await play.opened([(wire.MDI, wire.ACK)])
    play.servers[0].afterwards = {
        "get abs_act_pos": elsewhere,
        "get error": [b"ERROR joint 2 following error\r\n", b"ERROR OK\r\n"],
    }
    with pytest.raises(MotionInterrupted, match=r"before reaching X10\.000 Y20\.000 Z560") as caught:
        await driver.move(wire.TARGET, wire.MOVE_S)
    assert "joint 2 following error" in caught.value.problem


@pytest.mark.parametrize(
    ("state", "why"),
    [
        ("get estop: ON", "it is in emergency stop"),
        ("get estop: OFF | get machine: OFF", "it is switched off"),
        ("get estop: OFF | get machine: ON", "it is on, and gives no reason"),
    ],
)
async def test_a_move_that_ends_elsewhere_without_an_error_message_is_reported(play, state, why):
    play.patience = play.IMPATIENT
    driver = await play.opened([(wire.MDI, wire.ACK)])
    play.servers[0].afterwards = {
        "get abs_act_pos": wire.HALF_WAY,
        **dict([wire.NO_ERROR, *wire.said(state)]),
    }
    with pytest.raises(MotionInterrupted, match=f"stopped at X5.000 Y10.000 Z555.000 .*: {why}"):
        await driver.move(wire.TARGET, wire.MOVE_S)


async def test_a_refused_move_reports_and_clears_all_error_messages(play):
    errors = wire.said(
        "get error: Linear move on line 0 fails kinematicsInverse | "
        "get error: invalid params in linear command | get error: OK"
    )
    driver = await play.opened([*wire.REFUSED, *errors, *wire.MOVED, wire.RESTORED])
    with pytest.raises(MoveRefused, match="fails kinematicsInverse; invalid params in linear command"):
        await driver.move(wire.TARGET, wire.MOVE_S)
    await driver.move(wire.TARGET, wire.MOVE_S)


async def test_reading_error_messages_ends_if_the_same_message_repeats(play):
    driver = await play.opened(wire.REFUSED)
    play.servers[0].afterwards = dict(wire.said("get error: emc_error: bad status from EMC"))
    with pytest.raises(MoveRefused, match=r": emc_error: bad status from EMC$"):
        await driver.move(wire.TARGET, wire.MOVE_S)


async def test_a_move_does_not_retake_control_from_another_client(play):
    driver = await play.opened([(wire.MDI, wire.NAK), *wire.said("get enable: OFF")] * 2)
    for _ in range(2):
        with pytest.raises(MoveRefused, match=r"another client has taken control of it\. See that nobody"):
            await driver.move(wire.TARGET, wire.MOVE_S)


async def test_a_move_that_exceeds_its_timeout_is_stopped_and_its_late_answer_is_discarded(play):
    play.patience = replace(play.patience, beyond_move=0.01)
    stopped = play.Pause()
    driver = await play.opened(
        [(wire.MDI.replace("F20.", "F6000."), stopped, wire.ACK), wire.AGAIN_IN_CONTROL, wire.JOINTS],
        [*play.GREETING, wire.ABORT, *play.STOPPING[-3:]],
    )
    with pytest.raises(MotionInterrupted, match=r"still moving after 0\.03 s and was stopped"):
        await driver.move(wire.TARGET, 0.01)
    stopped.set()
    assert await joints_of(driver) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


async def test_a_connection_lost_during_a_move_stops_the_machine_or_asks_for_the_emergency_stop(play):
    driver = await play.opened([(wire.MDI, play.HANG_UP)], play.STOPPING)
    with pytest.raises(ConnectionLost, match="closed the connection"):
        await driver.move(wire.TARGET, wire.MOVE_S)
    driver = await play.opened(
        [(wire.MDI, play.HANG_UP)], *[[("hello EMC hexacell 1.0", play.HANG_UP)]] * 3
    )
    with pytest.raises(DeviceError, match=r"could not be stopped: it closed .*\. Press the emer"):
        await driver.move(wire.TARGET, wire.MOVE_S)


async def test_the_position_is_pose_and_joints_of_a_homed_machine_alone(play) -> None:
    """After a restart the first answers may be those of home."""
    driver = await play.opened([*wire.HOMED, ("get abs_act_pos", wire.HALF_WAY), wire.JOINTS])
    found = await driver.position()
    assert found is not None
    assert found.pose == Pose(5.0, 10.0, 555.0, 2.5, -2.0, 1.5)
    assert found.joints == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    driver = await play.opened([("get joint_homed", b"JOINT_HOMED YES YES NO YES YES YES\r\n")])
    assert await driver.position() is None


REFUSALS = [
    ("Linear move on line 0 would exceed C's positive limit", "c", True),
    ("Linear move on line 0 would exceed X's negative limit", "x", False),
    ("Linear move on line 0 would exceed joint 3's positive limit", None, True),
    ("Linear move on line 0 fails kinematicsInverse", None, True),
]


@pytest.mark.parametrize(("message", "axis", "is_highest"), REFUSALS)
async def test_a_pose_beyond_a_limit_is_refused_as_a_pose(play, message, axis, is_highest):
    errors = wire.said(
        f"get error: {message} | get error: invalid params in linear command | get error: OK"
    )
    driver = await play.opened([*wire.REFUSED, *errors, *wire.MOVED, wire.RESTORED])
    with pytest.raises(PoseRefused, match=message) as refused:
        await driver.move(wire.TARGET, wire.MOVE_S)
    assert (refused.value.axis, refused.value.is_highest) == (axis, is_highest)
    await driver.move(wire.TARGET, wire.MOVE_S)


async def test_a_refused_pose_whose_command_is_acknowledged_is_refused_all_the_same(play):
    play.patience = play.IMPATIENT
    driver = await play.opened([])
    play.servers[0].afterwards = {
        wire.MDI: wire.ACK,
        "get abs_act_pos": wire.HALF_WAY,
        "get error": [b"ERROR Linear move on line 0 would exceed C's positive limit\r\n", wire.NO_ERROR[1]],
    }
    with pytest.raises(PoseRefused, match="would exceed C's positive limit"):
        await driver.move(wire.TARGET, wire.MOVE_S)


[MODES] = wire.said("get program_codes: G1 G17 G40 G21 G90 G94 G54 G49 F250 S0")
CONTROL = [wire.AGAIN_IN_CONTROL, wire.NO_ERROR, *wire.said("set set_wait done")]
READY = [*CONTROL, *wire.NO_ESTOP, *wire.IS_ON, *wire.HOMED, *wire.MDI_MODE]
CHECKED = [wire.UNITS, MODES, wire.OFFSETS, wire.OVERRIDE]
[RESTORED_HERE] = wire.said("set mdi G94 G1 F250")
REFUSED_TO_RESTORE = wire.said("set mdi G94 G1 F250: NAK | get enable: ON")
STATE = wire.said("get error: OK | get estop: OFF | get machine: ON")


async def test_modes_that_are_not_restored_are_reported_with_the_reason_if_there_is_one(play) -> None:
    reason = wire.said("get error: must be in MDI mode | get error: OK")
    driver = await play.opened([*READY, *CHECKED, *wire.MOVED, *REFUSED_TO_RESTORE, *reason, RESTORED_HERE])
    await driver.prepare(frozenset())
    with pytest.raises(CommandRefused, match="must be in MDI mode"):
        await driver.move(wire.TARGET, wire.MOVE_S)
    await driver.close()
    play.patience = play.IMPATIENT
    driver = await play.opened([*READY, *CHECKED, *wire.MOVED])
    play.servers[-1].afterwards = dict([*REFUSED_TO_RESTORE, *STATE])
    await driver.prepare(frozenset())
    with pytest.raises(CommandRefused, match="it is on, and gives no reason"):
        await driver.move(wire.TARGET, wire.MOVE_S)


async def test_an_inch_machine_is_commanded_in_mm_and_what_it_tells_is_converted(play):
    inches = wire.said(
        "get user_linear_units: INCH | get program_codes: G0 G17 G40 G20 G90 G94 G54 G49 F0 S0"
    )
    there = wire.said("get abs_act_pos: 0.393701 0.787402 22.047244 5.000000 -4.000000 3.000000")
    told = [*wire.HOMED, *there, *wire.said("get joint_pos: 1.0 2.0 -3.0 4.0 5.0 6.0")]
    moved = [(wire.MDI, wire.ACK), *there, *wire.said("set mdi G20 G94 G0")]
    driver = await play.opened([*READY, *inches, *CHECKED[2:], *moved, *told], unit_mm=25.4)
    await driver.prepare(frozenset())
    await driver.move(wire.TARGET, wire.MOVE_S)
    reported = await driver.position()
    assert reported is not None
    assert reported.joints == pytest.approx((25.4, 50.8, -76.2, 101.6, 127.0, 152.4))
    assert reported.pose.as_tuple() == pytest.approx(wire.TARGET.as_tuple(), abs=2e-5)


async def test_the_modes_that_a_stopped_move_leaves_are_restored_by_preparing_or_closing(play) -> None:
    play.patience = play.IMPATIENT
    driver = await play.opened([*READY, *CHECKED, *wire.REFUSED, *STATE, *READY, RESTORED_HERE, *CHECKED])
    await driver.prepare(frozenset())
    with pytest.raises(MoveRefused):
        await driver.move(wire.TARGET, wire.MOVE_S)
    await driver.prepare(frozenset())
    driver = await play.opened([*READY, *CHECKED, *wire.REFUSED, *STATE, RESTORED_HERE])
    await driver.prepare(frozenset())
    with pytest.raises(MoveRefused):
        await driver.move(wire.TARGET, wire.MOVE_S)
    await driver.close()


@pytest.mark.parametrize(
    ("percent", "is_refused"), [(b"100", False), (b"50", False), (b"120", True), (b"strange", False)]
)
async def test_a_feed_override_that_makes_moves_faster_is_refused(play, percent, is_refused):
    override = ("get feed_override", b"FEED_OVERRIDE " + percent + b"\r\n")
    driver = await play.opened([*READY, *CHECKED[:-1], override])
    if not is_refused:
        await driver.prepare(frozenset())
        return
    with pytest.raises(DeviceError, match=r"moves 120 % as fast as it is commanded \(feed override\)"):
        await driver.prepare(frozenset())
