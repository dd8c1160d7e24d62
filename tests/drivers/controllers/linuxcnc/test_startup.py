"""Preparing for motion: every state is verified after its command is acknowledged."""

import pytest

from drivers.errors import CommandRefused, MotionInterrupted, MoveRefused, StartupNotPermitted
from drivers.interfaces import StartupAction
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from tests.drivers.controllers.linuxcnc.conftest import (
    CODES,
    HOMED,
    HOMING,
    IN_ESTOP,
    IN_JOINT_MODE,
    IS_ON,
    MDI_MODE,
    NO_ERROR,
    NO_ESTOP,
    NOT_HOMED,
    OFF,
    ON_NOT_HOMED,
    OWN_COORDINATES,
    READY,
    SWITCHING_ON,
    TAKING_CONTROL,
    UNITS,
    said,
)

ALL = frozenset(StartupAction)
RESETTING = [*IN_ESTOP, *NOT_HOMED, *said("set estop off"), *NO_ESTOP]
UNTIL_HOMED = [*TAKING_CONTROL, *SWITCHING_ON]
UNTIL_MDI = [*UNTIL_HOMED, *READY, *MDI_MODE]


async def test_prepare_leads_from_emergency_stop_and_teleoperation_to_mdi_and_waits_for_each(play) -> None:
    until_homed = [*TAKING_CONTROL, *RESETTING, *SWITCHING_ON, *ON_NOT_HOMED, *OWN_COORDINATES]
    homed = [*IN_JOINT_MODE, *HOMING, *READY, *MDI_MODE, *OWN_COORDINATES]
    driver = await play.opened([*until_homed, *homed])
    await driver.prepare(ALL)
    leaving = said("set mode manual | get teleop_enable: YES | set teleop_enable off | get error: OK")
    homed = [*leaving, *HOMING, *READY, *MDI_MODE, *OWN_COORDINATES]
    driver = await play.opened([*UNTIL_HOMED, *ON_NOT_HOMED, *OWN_COORDINATES, *homed])
    await driver.prepare(ALL)
    reset = [*TAKING_CONTROL, *RESETTING[:-1], *IN_ESTOP, *NO_ESTOP, *SWITCHING_ON[:-1], OFF[-1], *IS_ON]
    mode = said("set mode mdi | get mode: MANUAL | get mode: MDI")
    driver = await play.opened([*reset, *READY, *mode, *OWN_COORDINATES])
    await driver.prepare(ALL)


async def test_a_mode_that_was_asked_for_without_effect_is_asked_for_again(play):
    play.patience = play.IMPATIENT
    driver = await play.opened([*UNTIL_HOMED, *READY, MDI_MODE[0]])
    afterwards = play.servers[0].afterwards

    def second_request() -> bytes:
        afterwards["get mode"] = b"MODE MDI\r\n"
        return MDI_MODE[0][1]

    afterwards |= {"get mode": b"MODE MANUAL\r\n", "set mode mdi": second_request}
    afterwards |= dict(OWN_COORDINATES)
    await driver.prepare(ALL)


async def test_a_machine_that_is_not_switched_on_without_a_reason_is_asked_again(play):
    play.patience = play.IMPATIENT
    driver = await play.opened([*TAKING_CONTROL, *SWITCHING_ON[:-1]])
    afterwards = play.servers[0].afterwards

    def second_request() -> bytes:
        afterwards["get machine"] = IS_ON[0][1]
        return SWITCHING_ON[-2][1]

    afterwards |= {"get machine": OFF[-1][1], "get error": NO_ERROR[1], "set machine on": second_request}
    afterwards |= dict([*NO_ESTOP, *HOMED, *MDI_MODE, *OWN_COORDINATES])
    await driver.prepare(ALL)


async def test_prepare_accepts_a_server_without_the_optional_queries(play):
    unknown = [(asked, b"GET NAK\r\n") for asked, _ in OWN_COORDINATES for _twice in range(2)]
    driver = await play.opened([*UNTIL_MDI, *unknown])
    await driver.prepare(ALL)


@pytest.mark.parametrize(
    ("conversation", "states", "problem"),
    [
        (
            [*TAKING_CONTROL, *RESETTING[:-1]],
            dict(said("get estop: ON | get error: OK")),
            "stays in emergency stop: it is in emergency stop. Release",
        ),
        (
            [*TAKING_CONTROL, *SWITCHING_ON[:-1]],
            dict(said("set machine on | get machine: OFF | get estop: OFF | get error: OK")),
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
            [*UNTIL_HOMED, *READY, MDI_MODE[0]],
            dict([*said("set mode mdi | get mode: MANUAL"), *NO_ESTOP, *IS_ON, NO_ERROR]),
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
        (said("get user_linear_units: INCH"), "counts in inch, .*Set controller.unit_mm = 25.4"),
        (said("get user_linear_units: CUSTOM"), r"counts in custom, .*Set \[TRAJ\] LINEAR_UNITS = mm"),
        ([UNITS, *said("get program_codes: G0 G91 G49")], r"takes coordinates as relative \(G91\). G90"),
        ([UNITS, *said("get program_codes: G0 G90 G43")], r"adds a tool length \(G43\). G49"),
        ([UNITS, CODES, *said("get pos_offset: 0 -5.0 0 0 0 0")], r"adds an offset of 0 -5\.0 .*Clear it"),
        ([UNITS, CODES, *said("get pos_offset: 0 garbled")], "'0 garbled' where six positions belong"),
    ],
)


@FALSE_COORDINATES
async def test_settings_that_falsify_coordinates_are_found_at_once(play, conversation, problem) -> None:
    driver = await play.opened([*UNTIL_MDI, *conversation])
    with pytest.raises(DeviceError, match=problem):
        await driver.prepare(ALL)
    with pytest.raises(MoveRefused, match=r"its last preparation failed\. Prepare it again"):
        await driver.move(Pose(0.0, 0.0, 500.0), 1.0)
    driver = await play.opened(conversation)
    with pytest.raises(DeviceError, match=problem):
        await driver.check()


async def test_a_refusal_quotes_the_controllers_error_messages_also_without_a_nak(play) -> None:
    refused = said("set machine on: NAK | get enable: ON")
    errors = [("get error", f"ERROR drive {n} is cold\r\n".encode()) for n in (1, 2, 3, 4, 5, 5)]
    driver = await play.opened([*TAKING_CONTROL, *OFF, *refused, *errors, NO_ERROR])
    with pytest.raises(CommandRefused) as caught:
        await driver.prepare(ALL)
    four = "drive 1 is cold; drive 2 is cold; drive 3 is cold; drive 4 is cold"
    assert caught.value.problem == f"refuses 'set machine on': {four}; and 1 more"
    without_nak = b"error: Cannot issue SET MODE command while SET MDI command is still active\r\n"
    why = said("get enable: ON | get error: OK")
    driver = await play.opened([*UNTIL_MDI[:-2], ("set mode mdi", without_nak), *why])
    with pytest.raises(CommandRefused, match="while SET MDI command is still active"):
        await driver.prepare(ALL)


async def test_a_stop_during_prepare_prevents_homing(play):
    stopped = play.Pause()
    held = [IN_JOINT_MODE[0], ("get teleop_enable", stopped, b"TELEOP_ENABLE NO\r\n"), NO_ERROR]
    main = [*UNTIL_HOMED, *ON_NOT_HOMED, *OWN_COORDINATES, *held]
    driver = await play.opened(main, play.STOPPING)
    preparing = await stopped.reached_by(driver.prepare(ALL))
    await driver.stop()
    stopped.set()
    with pytest.raises(MotionInterrupted, match="was stopped before it was ready"):
        await preparing


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
