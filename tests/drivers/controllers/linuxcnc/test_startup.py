"""Preparing for motion: every state is verified after its command is acknowledged."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from drivers.errors import CommandRefused, MotionInterrupted, MoveRefused, StartupNotPermitted
from drivers.interfaces import StartupAction
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

ALL = frozenset(StartupAction)
NO_ERROR = ("get error", b"ERROR OK\r\n")
TAKING_CONTROL = [
    ("set enable EMCTOO", b"SET ENABLE ACK\n\r"),
    ("get error", b"ERROR left over from somebody else\r\n"),
    NO_ERROR,
    ("set set_wait done", b"SET SET_WAIT ACK\n\r"),
]
IN_ESTOP = [("get estop", b"ESTOP ON\r\n")]
NO_ESTOP = [("get estop", b"ESTOP OFF\r\n")]
OFF = [*NO_ESTOP, ("get machine", b"MACHINE OFF\r\n")]
ON = [("get machine", b"MACHINE ON\r\n")]
HOMED = [("get joint_homed", b"JOINT_HOMED YES YES YES YES YES YES\r\n")]
NOT_HOMED = [("get joint_homed", b"JOINT_HOMED YES YES NO YES YES YES\r\n")]
RESETTING = [*IN_ESTOP, *NOT_HOMED, ("set estop off", b"SET ESTOP ACK\n\r"), *NO_ESTOP]
SWITCHING_ON = [*OFF, ("set machine on", b"SET MACHINE ACK\n\r"), *ON]
ON_NOT_HOMED = [*NO_ESTOP, *ON, *NOT_HOMED]
READY = [*NO_ESTOP, *ON, *HOMED]
IN_JOINT_MODE = [
    ("set mode manual", b"SET MODE ACK\n\r"),
    ("get teleop_enable", b"TELEOP_ENABLE NO\r\n"),
    NO_ERROR,
]
HOMING = [("set home -1", b"SET HOME ACK\n\r"), *NOT_HOMED, *HOMED]
MDI = [("set mode mdi", b"SET MODE ACK\n\r"), ("get mode", b"MODE MDI\r\n")]
UNITS = ("get user_linear_units", b"USER_LINEAR_UNITS MM\r\n")
CODES = ("get program_codes", b"PROGRAM_CODES G80 G17 G40 G21 G90 G94 G54 G49 G92.2 F0 S0\r\n")
OFFSETS = ("get pos_offset", b"POS_OFFSET 0.000000 0.000000 -0.000000 0.000000 0.000000 0.000000\r\n")
OVERRIDE = ("get feed_override", b"FEED_OVERRIDE 100\r\n")
OWN_COORDINATES = [UNITS, CODES, OFFSETS, OVERRIDE]
UNTIL_HOMED = [*TAKING_CONTROL, *SWITCHING_ON]
UNTIL_MDI = [*UNTIL_HOMED, *READY, *MDI]


async def test_prepare_releases_the_emergency_stop_switches_on_and_homes(play):
    driver = await play.opened(
        [
            *TAKING_CONTROL,
            *RESETTING,
            *SWITCHING_ON,
            *ON_NOT_HOMED,
            *OWN_COORDINATES,
            *IN_JOINT_MODE,
            *HOMING,
            *READY,
            *MDI,
            *OWN_COORDINATES,
        ]
    )
    await driver.prepare(ALL)


async def test_homing_leaves_teleoperation_first(play):
    driver = await play.opened(
        [
            *UNTIL_HOMED,
            *ON_NOT_HOMED,
            *OWN_COORDINATES,
            ("set mode manual", b"SET MODE ACK\n\r"),
            ("get teleop_enable", b"TELEOP_ENABLE YES\r\n"),
            ("set teleop_enable off", b"SET TELEOP_ENABLE ACK\n\r"),
            NO_ERROR,
            *HOMING,
            *READY,
            *MDI,
            *OWN_COORDINATES,
        ]
    )
    await driver.prepare(ALL)


async def test_prepare_waits_until_each_state_is_reached(play):
    driver = await play.opened(
        [
            *TAKING_CONTROL,
            *RESETTING[:-1],
            *IN_ESTOP,
            *NO_ESTOP,
            *SWITCHING_ON[:-1],
            OFF[-1],
            *ON,
            *READY,
            MDI[0],
            ("get mode", b"MODE MANUAL\r\n"),
            MDI[1],
            *OWN_COORDINATES,
        ]
    )
    await driver.prepare(ALL)


async def test_a_mode_that_was_asked_for_without_effect_is_asked_for_again(play):
    play.patience = play.IMPATIENT
    driver = await play.opened([*UNTIL_HOMED, *READY, MDI[0]])
    afterwards = play.servers[0].afterwards

    def second_request() -> bytes:
        afterwards["get mode"] = b"MODE MDI\r\n"
        return MDI[0][1]

    afterwards |= {"get mode": b"MODE MANUAL\r\n", "set mode mdi": second_request}
    afterwards |= dict(OWN_COORDINATES)
    await driver.prepare(ALL)


async def test_a_machine_that_is_not_switched_on_without_a_reason_is_asked_again(play):
    play.patience = play.IMPATIENT
    driver = await play.opened([*TAKING_CONTROL, *SWITCHING_ON[:-1]])
    afterwards = play.servers[0].afterwards

    def second_request() -> bytes:
        afterwards["get machine"] = ON[0][1]
        return SWITCHING_ON[-2][1]

    afterwards |= {"get machine": OFF[-1][1], "get error": NO_ERROR[1], "set machine on": second_request}
    afterwards |= dict([*NO_ESTOP, *HOMED, *MDI, *OWN_COORDINATES])
    await driver.prepare(ALL)


async def test_a_change_of_state_may_take_as_long_as_a_command_not_as_a_query(play):
    """The limit that ends the wait is that of commands: queries would be waited for for an hour."""
    play.patience = replace(play.patience, answer=3600.0, command=0.05)
    never = play.Pause()
    switching = [*OFF, ("set machine on", never, b"SET MACHINE ACK\n\r")]
    driver = await play.opened([*TAKING_CONTROL, *switching])
    with pytest.raises(DeviceError, match=r"did not answer 'set machine' within 0\.05 s"):
        await driver.prepare(ALL)


async def test_prepare_accepts_a_server_without_the_optional_queries(play):
    unknown = [
        ("get user_linear_units", b"GET USER_LINEAR_UNITS NAK\r\n\r\n"),
        ("get program_codes", b"GET PROGRAM_CODES NAK\r\n\r\n"),
        ("get pos_offset", b"GET NAK\r\n"),
        ("get feed_override", b"GET NAK\r\n"),
    ]
    driver = await play.opened([*UNTIL_MDI, *(ask for question in unknown for ask in (question,) * 2)])
    await driver.prepare(ALL)


@pytest.mark.parametrize(
    ("conversation", "states", "problem"),
    [
        (
            [*TAKING_CONTROL, *RESETTING[:-1]],
            {"get estop": b"ESTOP ON\r\n", "get error": b"ERROR OK\r\n"},
            "stays in emergency stop: it is in emergency stop. Release",
        ),
        (
            [*TAKING_CONTROL, *SWITCHING_ON[:-1]],
            {
                "set machine on": b"SET MACHINE ACK\n\r",
                "get machine": b"MACHINE OFF\r\n",
                "get estop": b"ESTOP OFF\r\n",
                "get error": b"ERROR OK\r\n",
            },
            "does not switch on: it is switched off",
        ),
        (
            [*TAKING_CONTROL, *SWITCHING_ON[:-1]],
            {  # asked for once: a second request would be none of the script
                "get machine": b"MACHINE OFF\r\n",
                "get error": [b"ERROR joint 3 following error\r\n", b"ERROR OK\r\n"],
            },
            "does not switch on: joint 3 following error",
        ),
        (
            [*UNTIL_HOMED, *READY, MDI[0]],
            {
                "set mode mdi": MDI[0][1],
                "get mode": b"MODE MANUAL\r\n",
                "get estop": b"ESTOP OFF\r\n",
                "get machine": b"MACHINE ON\r\n",
                "get error": b"ERROR OK\r\n",
            },
            "does not enter MDI mode: it is on, and gives no reason",
        ),
        (
            [*UNTIL_HOMED, *ON_NOT_HOMED, *OWN_COORDINATES, *IN_JOINT_MODE, HOMING[0]],
            {
                "get joint_homed": b"JOINT_HOMED NO NO NO NO NO NO\r\n",
                "get error": [b"ERROR home switch of joint 2 not found\r\n", b"ERROR OK\r\n"],
            },
            r"is not homed after 0\.2 s: home switch of joint 2 not found",
        ),
    ],
)
async def test_an_acknowledged_command_without_effect_is_reported(play, conversation, states, problem):
    play.patience = play.IMPATIENT
    driver = await play.opened(conversation, homing_timeout_s=0.2)
    play.servers[0].afterwards = states
    with pytest.raises(DeviceError, match=problem) as caught:
        await driver.prepare(ALL)
    assert caught.value.subject == f"controller 127.0.0.1:{play.servers[0].port}"


FALSE_COORDINATES = pytest.mark.parametrize(
    ("conversation", "problem"),
    [
        (
            [("get user_linear_units", b"USER_LINEAR_UNITS INCH\r\n")],
            r"counts in inch, controller.unit_mm is 1. Set controller.unit_mm = 25.4",
        ),
        (
            [("get user_linear_units", b"USER_LINEAR_UNITS CUSTOM\r\n")],
            r"counts in custom, controller.unit_mm is 1. Set \[TRAJ\] LINEAR_UNITS = mm",
        ),
        (
            [UNITS, ("get program_codes", b"PROGRAM_CODES G0 G17 G21 G91 G54 G49\r\n")],
            r"takes coordinates as relative \(G91\). G90",
        ),
        (
            [UNITS, ("get program_codes", b"PROGRAM_CODES G0 G17 G21 G90 G54 G43\r\n")],
            r"adds a tool length \(G43\). G49",
        ),
        (
            [UNITS, CODES, ("get pos_offset", b"POS_OFFSET 0.0 -5.0 0.0 0.0 0.0 0.0\r\n")],
            r"adds an offset of 0\.0 -5\.0 .*Clear it",
        ),
    ],
)


@FALSE_COORDINATES
async def test_settings_that_falsify_coordinates_are_refused_and_then_nothing_moves(
    play, conversation, problem
):
    driver = await play.opened([*UNTIL_MDI, *conversation])
    with pytest.raises(DeviceError, match=problem):
        await driver.prepare(ALL)
    with pytest.raises(MoveRefused, match=r"its last preparation failed\. Prepare it again"):
        await driver.move(Pose(0.0, 0.0, 500.0), 1.0)


@FALSE_COORDINATES
async def test_a_check_finds_them_and_sets_nothing(play, conversation, problem):
    driver = await play.opened(conversation)
    with pytest.raises(DeviceError, match=problem):
        await driver.check()


async def test_a_refusal_quotes_the_controllers_error_messages(play):
    driver = await play.opened(
        [
            *TAKING_CONTROL,
            *OFF,
            ("set machine on", b"SET MACHINE NAK\n\r"),
            ("get enable", b"ENABLE ON\r\n"),
            *[("get error", f"ERROR drive {n} is cold\r\n".encode()) for n in (1, 2, 3, 4, 5, 5)],
            NO_ERROR,
        ]
    )
    with pytest.raises(CommandRefused) as caught:
        await driver.prepare(ALL)
    four = "drive 1 is cold; drive 2 is cold; drive 3 is cold; drive 4 is cold"
    assert caught.value.problem == f"refuses 'set machine on': {four}; and 1 more"


async def test_the_explanations_of_2_10_come_with_the_refusal(play):
    driver = await play.opened(
        [
            *TAKING_CONTROL,
            *OFF,
            ("set machine on", b"error: Waiting for 'SET MACHINE ON' failed\r\nSET MACHINE NAK\r\n"),
            ("get enable", b"ENABLE ON\r\n"),
            NO_ERROR,
        ]
    )
    with pytest.raises(
        CommandRefused, match="refuses 'set machine on': Waiting for 'SET MACHINE ON' failed"
    ):
        await driver.prepare(ALL)


async def test_a_refusal_of_2_10_without_a_nak(play):
    driver = await play.opened(
        [
            *TAKING_CONTROL,
            *UNTIL_MDI[4:-2],
            (
                "set mode mdi",
                b"error: Cannot issue SET MODE command while SET MDI command is still active\r\n",
            ),
            ("get enable", b"ENABLE ON\r\n"),
            NO_ERROR,
        ]
    )
    with pytest.raises(CommandRefused, match="while SET MDI command is still active"):
        await driver.prepare(ALL)


async def test_a_stop_during_prepare_prevents_homing(play):
    stopped = play.Pause()
    driver = await play.opened(
        [
            *UNTIL_HOMED,
            *ON_NOT_HOMED,
            *OWN_COORDINATES,
            IN_JOINT_MODE[0],
            ("get teleop_enable", stopped, b"TELEOP_ENABLE NO\r\n"),
            NO_ERROR,
        ],
        play.STOPPING,
    )
    preparing = asyncio.create_task(driver.prepare(ALL))
    await stopped.reached.wait()
    await driver.stop()
    stopped.set()
    with pytest.raises(MotionInterrupted, match="was stopped before it was ready"):
        await preparing


async def test_positions_that_are_not_finite_are_refused(play):
    driver = await play.opened([("get abs_act_pos", b"ABS_ACT_POS 1.0 nan 0.0 0.0 0.0 0.0\r\n")])
    with pytest.raises(DeviceError, match=r"controller .*it reports '1\.0 nan"):
        await driver.pose()


async def test_too_few_joint_positions_are_refused(play):
    driver = await play.opened([("get joint_pos", b"JOINT_POS 1.0 2.0 3.0\r\n")])
    with pytest.raises(DeviceError, match="where six positions belong"):
        await driver.joint_positions()


ESTOP_AT_START = [*IN_ESTOP, *NOT_HOMED]
LATER_ESTOP = [*IN_ESTOP, *HOMED]


@pytest.mark.parametrize(
    ("state", "needed", "problem"),
    [
        (ESTOP_AT_START, StartupAction.RESET_INITIAL_ESTOP, "is in emergency stop since it was started"),
        (LATER_ESTOP, StartupAction.RESET_ESTOP, "is in emergency stop$"),
        (OFF, StartupAction.SWITCH_ON, "is switched off"),
        (ON_NOT_HOMED, StartupAction.HOME, "is not homed"),
    ],
)
async def test_what_is_not_permitted_is_not_done(play, state, needed, problem):
    """The script has no ``set estop off``, ``set machine on`` or ``set home``: sending one would fail."""
    driver = await play.opened([*TAKING_CONTROL, *state])
    with pytest.raises(StartupNotPermitted, match=problem) as refusal:
        await driver.prepare(ALL - {needed})
    assert refusal.value.needed is needed


async def test_an_emergency_stop_that_returns_is_not_reset_again(play):
    driver = await play.opened([*TAKING_CONTROL, *RESETTING, *ESTOP_AT_START])
    with pytest.raises(StartupNotPermitted, match="is in emergency stop since it was started"):
        await driver.prepare(ALL)
