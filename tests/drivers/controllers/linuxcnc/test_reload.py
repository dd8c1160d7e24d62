"""Reloading the config: switching off, the owner's reload command, switching on; no slider moves."""

import asyncio
import os
import shutil
import signal
import sys

import pytest

from drivers.controllers.reload_command import run_reload_command
from drivers.errors import ConnectionLost, StartupNotPermitted
from drivers.interfaces import StartupAction
from hexacell.errors import DeviceError
from tests.drivers.controllers.linuxcnc import conftest as wire
from tests.waiting import cancel, until

RESTARTED = frozenset({StartupAction.RESET_INITIAL_ESTOP, StartupAction.HOME})
"""What the cell file permits; to be switched on again needs no permission."""
BEFORE = wire.said("get machine: ON | get joint_pos: -461.827519 1.0 2.0 3.0 4.0 5.0")
AFTER = wire.said("get joint_pos: -461.827512 1.0 2.0 3.0 4.0 5.0")
HOMED_AGAIN = [*wire.NOT_HOMED, *wire.OWN_COORDINATES, *wire.IN_JOINT_MODE, *wire.HOMING, *wire.READY]
REOPENED, DEAF = wire.OPENING[:-1], ("hello EMC hexacell 1.0", wire.Then.HANG_UP)
RESTARTS, RESET = [*wire.IN_ESTOP, *wire.NOT_HOMED], wire.said("set estop off | get estop: OFF")
TURNED_OFF = wire.said("set machine off | get machine: OFF")
ON = [*wire.SWITCHING_ON, *wire.NO_ESTOP, *wire.IS_ON]


def python(program: str) -> tuple[str, ...]:
    return (sys.executable, "-c", program)


RESTARTING = [*BEFORE, TURNED_OFF[0], (*TURNED_OFF[1], wire.Then.HANG_UP)]
COMMAND = {"reload_command": python("pass")}


@pytest.mark.parametrize(
    ("conversations", "settings"),
    [
        ([[*BEFORE, *TURNED_OFF, *ON, *wire.HOMED, *AFTER, *wire.MDI_MODE]], {}),
        # joints that are homed after it, or include zeros, are not compared with where they were
        ([[*BEFORE, *TURNED_OFF, *ON, *HOMED_AGAIN, *wire.MDI_MODE]], {}),
        ([[*BEFORE, *TURNED_OFF, *ON, *wire.HOMED, *wire.MDI_MODE]], {"joints_include_zeros": True}),
        # a command that restarts the controller, which is connected to again as soon as it answers
        ([RESTARTING, [*REOPENED, *RESTARTS, *RESET, *ON, *HOMED_AGAIN, *wire.MDI_MODE]], COMMAND),
        ([RESTARTING, [DEAF], [*REOPENED, *ON, *wire.HOMED, *AFTER, *wire.MDI_MODE]], COMMAND),
    ],
)
async def test_the_machine_goes_off_and_on(play, conversations, settings):
    driver = await play.opened(*conversations, **settings)
    await driver.reload(RESTARTED)


async def test_the_command_runs_while_the_machine_is_off(play, tmp_path):
    ran = tmp_path / "ran"
    driver = await play.opened(
        [*BEFORE, *TURNED_OFF, *ON, *wire.HOMED, *AFTER, *wire.MDI_MODE],
        reload_command=python(f"open({str(ran)!r}, 'w').close()"),
    )
    await driver.reload(RESTARTED)
    assert ran.exists()


async def test_a_machine_that_does_not_go_off_is_not_reloaded(play, tmp_path):
    play.patience = play.IMPATIENT
    ran = tmp_path / "ran"
    driver = await play.opened(
        [*BEFORE, TURNED_OFF[0]], reload_command=python(f"open({str(ran)!r}, 'w').close()")
    )
    play.servers[0].afterwards = dict([TURNED_OFF[0], *wire.IS_ON, wire.NO_ERROR, *wire.NO_ESTOP])
    with pytest.raises(DeviceError, match="does not switch off"):
        await driver.reload(RESTARTED)
    assert not ran.exists()


@pytest.mark.parametrize(
    ("program", "problem"),
    [
        ("import sys; sys.exit('S1x: no such pin')", r"with status 1: S1x: no such pin"),
        ("raise SystemExit(3)", r"failed with status 3\. Correct controller\.reload_command"),
    ],
)
async def test_a_command_that_fails_leaves_the_machine_off(play, program, problem):
    driver = await play.opened([*BEFORE, *TURNED_OFF], reload_command=python(program))
    with pytest.raises(DeviceError, match=problem) as caught:
        await driver.reload(RESTARTED)
    assert "the machine is off" in str(caught.value)


async def test_a_joint_that_moved_is_an_error(play):
    moved = ("get joint_pos", b"JOINT_POS -461.827512 1.0 2.0 9.8 4.0 5.0\r\n")
    driver = await play.opened([*BEFORE, *TURNED_OFF, *ON, *wire.HOMED, moved])
    with pytest.raises(DeviceError, match=r"moved joint 4 by 6\.800 mm while it read its config again"):
        await driver.reload(RESTARTED)


@pytest.mark.parametrize(
    ("conversations", "settings", "permitted", "told"),
    [
        ([[*BEFORE, *TURNED_OFF, *wire.IN_ESTOP, *wire.HOMED]], {}, RESTARTED, "is in emergency stop"),
        ([[*wire.IS_OFF, *TURNED_OFF, *wire.OFF]], {}, RESTARTED, "is switched off"),
        (
            [RESTARTING, [*REOPENED, *RESTARTS]],
            COMMAND,
            frozenset({StartupAction.HOME}),
            "since it was started",
        ),
    ],
    ids=["stopped meanwhile", "off before", "restarted"],
)
async def test_nothing_is_reset_or_switched_on_without_permission(
    play, conversations, settings, permitted, told
):
    play.patience = play.IMPATIENT
    driver = await play.opened(*conversations, **settings)
    with pytest.raises(StartupNotPermitted, match=told):
        await driver.reload(permitted)


async def test_after_an_emergency_stop_meanwhile_the_machine_is_not_switched_on_without_permission(play):
    control = wire.said("set enable EMCTOO | get error: OK | set set_wait done")
    driver = await play.opened([*BEFORE, *TURNED_OFF, *wire.IN_ESTOP, *wire.HOMED, *control, *wire.OFF])
    with pytest.raises(StartupNotPermitted, match="is in emergency stop"):
        await driver.reload(RESTARTED)
    with pytest.raises(StartupNotPermitted, match="is switched off"):
        await driver.prepare(RESTARTED)


async def test_a_controller_that_does_not_restart_is_reported(play):
    play.patience = play.IMPATIENT
    driver = await play.opened(RESTARTING, **COMMAND)
    play.servers[0].stop_listening()
    with pytest.raises(ConnectionLost, match="cannot be reached: Connection refused"):
        await driver.reload(RESTARTED)


async def test_a_reload_command_that_cannot_be_run_is_reported(tmp_path):
    absent = str(tmp_path / "absent")
    with pytest.raises(DeviceError, match="absent' cannot be run: No such file or directory"):
        await run_reload_command((absent,), "controller", 5.0)


async def test_a_program_installed_beside_this_one_is_found_without_a_path_to_it(monkeypatch):
    monkeypatch.setenv("PATH", os.defpath)
    assert shutil.which("hexacell-set-pins") is None
    with pytest.raises(DeviceError, match="no HAL file is named"):
        await run_reload_command(("hexacell-set-pins",), "controller", 60.0)


async def test_a_reload_command_that_exceeds_its_timeout_is_killed(tmp_path):
    with pytest.raises(DeviceError, match=r"took longer than 0\.3 s"):
        await run_reload_command(_saying_who(tmp_path), "controller", 0.3)
    if (tmp_path / "pid").exists():  # else it was killed before it could say
        _expect_gone(tmp_path)


async def test_a_cancelled_reload_command_is_killed(tmp_path):
    running = asyncio.create_task(run_reload_command(_saying_who(tmp_path), "controller", 1800.0))
    await until((tmp_path / "pid").exists)
    await cancel(running)
    _expect_gone(tmp_path)


async def test_a_daemon_that_it_starts_is_not_waited_for(tmp_path):
    await run_reload_command(("sh", "-c", f"sleep 3600 & echo $! > {tmp_path}/pid"), "controller", 1800.0)
    os.kill(int((tmp_path / "pid").read_text()), signal.SIGKILL)


def _saying_who(folder):
    return ("sh", "-c", f"echo $$ > {folder}/new; mv {folder}/new {folder}/pid; exec sleep 3600")


def _expect_gone(folder):
    with pytest.raises(ProcessLookupError):
        os.kill(int((folder / "pid").read_text()), 0)
