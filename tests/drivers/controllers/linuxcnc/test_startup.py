"""From any state to one in which it accepts moves, and reloading; each step is verified."""

import asyncio
import os
import shutil
import signal
import sys

import pytest

from drivers.controllers.reload_command import run_reload_command
from drivers.errors import (
    CommandRefused,
    ConnectionLost,
    MotionInterrupted,
    MoveRefused,
    StartupNotPermitted,
)
from drivers.interfaces import StartupAction
from hexacell.errors import DeviceError
from tests.drivers.controllers.linuxcnc.conftest import ALL, MOVE_S, TARGET, Then, once
from tests.waiting import cancel, until

RESTARTED = frozenset({StartupAction.RESET_INITIAL_ESTOP, StartupAction.HOME})
"""What the cell file permits; to be switched on again needs no permission."""


@pytest.mark.parametrize("line", ["set mode mdi", "set machine on", "set estop off"])
async def test_what_is_acknowledged_without_effect_is_asked_for_again_once(
    driver, controller, line
) -> None:
    ack = f"SET {line.split()[1].upper()} ACK\n\r".encode()
    controller.says[line] = once(ack)
    await driver.prepare(ALL)
    await driver.move(TARGET, MOVE_S)
    await driver.reload(ALL)
    if line == "set mode mdi":
        return
    controller.says[line] = ack
    controller.state.set_estop(on=True)
    with pytest.raises(DeviceError, match=f"'{line[4:]}' has no effect: it is"):
        await driver.reload(ALL)


async def test_why_it_has_no_effect_is_what_it_says(driver, controller) -> None:
    controller.says["set machine on"] = b"SET MACHINE NAK\n\r"
    said = [f"ERROR drive {n} is cold\r\n".encode() for n in (1, 2, 3, 4, 5, 5)]
    controller.says["get error"] = lambda: (
        said.pop(0) if said and controller.count("set machine on") else b"ERROR OK\r\n"
    )
    with pytest.raises(CommandRefused) as caught:
        await driver.prepare(ALL)
    four = "drive 1 is cold; drive 2 is cold; drive 3 is cold; drive 4 is cold"
    assert caught.value.problem == f"refuses 'switch-on': 'machine on' has no effect: {four}; and 1 more"
    assert controller.count("set machine on") == 1


async def test_an_explanation_without_a_nak_is_a_refusal(driver, controller) -> None:
    """As 2.10 says it while another client moves the machine."""
    refusal = b"error: Cannot issue SET HOME command while SET MDI command is still active\r\n"
    controller.says["set home"] = refusal
    with pytest.raises(DeviceError, match=r"is not homed: Cannot issue .* still active"):
        await driver.prepare(ALL)


async def test_a_homing_that_fails_or_is_stopped_is_reported(driver, machine, controller) -> None:
    home = machine.home
    machine.home = lambda: controller.state._errors.append("home switch of joint 2 not found")
    controller.says["get joint_homed"] = b"JOINT_HOMED NO YES NO NO NO NO\r\n"
    with pytest.raises(DeviceError, match="is not homed: home switch of joint 2 not found"):
        await driver.prepare(ALL)
    controller.state.homed = False
    controller.says, machine.home = {}, lambda: (home(), machine._stop.wait())
    preparing = asyncio.create_task(driver.prepare(ALL))
    await until(lambda: controller.count("set home") == 2)
    await driver.stop()
    with pytest.raises(MotionInterrupted):
        await preparing


async def test_it_homes_again_out_of_teleoperation(driver, controller) -> None:
    await driver.prepare(ALL)
    controller.state.mode, controller.state.teleop, controller.state.homed = (
        controller.state.mode.MANUAL,
        True,
        False,
    )
    await driver.prepare(ALL)
    assert controller.count("set teleop_enable off") == 1


async def test_a_server_without_the_optional_queries_is_accepted(driver, controller) -> None:
    for what in ("user_linear_units", "program_codes", "pos_offset", "feed_override", "teleop_enable"):
        controller.says[f"get {what}"] = b"GET NAK\r\n"
    await driver.prepare(ALL)
    await driver.move(TARGET, MOVE_S)


@pytest.mark.parametrize(
    ("what", "said", "problem"),
    [
        ("user_linear_units", "INCH", "counts in inch, .*Set controller.unit_mm = 25.4"),
        ("user_linear_units", "CUSTOM", r"counts in custom, .*Set \[TRAJ\] LINEAR_UNITS = mm"),
        ("program_codes", "G0 G91 G49", r"takes coordinates as relative \(G91\). Send G90"),
        ("program_codes", "G0 G90 G43", r"adds a tool length \(G43\). Send G49"),
        ("pos_offset", "0 -5.0 0 0 0 0", r"adds an offset of 0 -5 .*Clear it"),
        ("pos_offset", "0 garbled", "'0 garbled' where 6 positions belong"),
        ("feed_override", "120", r"moves 120 % as fast as it is commanded \(feed override\)"),
        ("feed_override", "50", ""),
        ("feed_override", "strange", ""),
    ],
)
async def test_what_falsifies_coordinates_is_found_before_anything_moves(
    driver, controller, what, said, problem
) -> None:
    controller.says[f"get {what}"] = f"{what.upper()} {said}\r\n".encode()
    if not problem:
        await driver.check()
        await driver.prepare(ALL)
        return
    for look in (driver.check, lambda: driver.prepare(ALL)):
        with pytest.raises(DeviceError, match=problem):
            await look()
    assert controller.count("set home") == 0
    with pytest.raises(MoveRefused, match=r"its last preparation failed\. Prepare it again"):
        await driver.move(TARGET, MOVE_S)


@pytest.mark.parametrize(
    ("change", "needed", "problem"),
    [
        (
            lambda state: None,
            StartupAction.RESET_INITIAL_ESTOP,
            "is in emergency stop since it was started",
        ),
        (lambda state: setattr(state, "homed", True), StartupAction.RESET_ESTOP, "is in emergency stop$"),
        (lambda state: state.set_estop(on=False), StartupAction.SWITCH_ON, "is switched off"),
        (lambda state: None, StartupAction.HOME, "is not homed"),
    ],
)
async def test_what_is_not_permitted_is_not_done(driver, controller, change, needed, problem) -> None:
    change(controller.state)
    with pytest.raises(StartupNotPermitted, match=problem) as refusal:
        await driver.prepare(ALL - {needed})
    assert refusal.value.needed is needed
    assert (await driver.status()).may_move is (needed is StartupAction.HOME)


async def test_an_emergency_stop_that_returns_is_not_reset_again(driver, controller) -> None:
    controller.says["set machine on"] = lambda: controller.state.set_estop(on=True)
    with pytest.raises((StartupNotPermitted, CommandRefused)):
        await driver.prepare(ALL)
    assert controller.count("set estop off") == 1


def python(program: str) -> tuple[str, ...]:
    return (sys.executable, "-c", program)


async def test_reloading_runs_the_command_while_the_machine_is_off(make, machine, tmp_path) -> None:
    ran = tmp_path / "ran"
    driver = make(reload_command=python(f"open({str(ran)!r}, 'w').close()"))
    await driver.open()
    await driver.prepare(ALL)
    machine.switch_on = lambda on=machine.switch_on: (on(), ran.rename(tmp_path / "seen"))
    await driver.reload(RESTARTED)
    assert (tmp_path / "seen").exists()
    await driver.move(TARGET, MOVE_S)


async def test_a_machine_that_does_not_go_off_is_not_reloaded(make, controller, tmp_path) -> None:
    ran = tmp_path / "ran"
    driver = make(reload_command=python(f"open({str(ran)!r}, 'w').close()"))
    await driver.open()
    await driver.prepare(ALL)
    controller.says["set machine off"] = b"SET MACHINE ACK\n\r"
    with pytest.raises(DeviceError, match="'machine off' has no effect"):
        await driver.reload(RESTARTED)
    assert not ran.exists()


@pytest.mark.parametrize(
    ("program", "problem"),
    [
        ("import sys; sys.exit('S1x: no such pin')", r"with status 1: S1x: no such pin"),
        ("raise SystemExit(3)", r"failed with status 3\. Correct controller\.reload_command"),
    ],
)
async def test_a_command_that_fails_leaves_the_machine_off(make, controller, program, problem) -> None:
    driver = make(reload_command=python(program))
    await driver.open()
    await driver.prepare(ALL)
    with pytest.raises(DeviceError, match=problem) as caught:
        await driver.reload(RESTARTED)
    assert "the machine is off" in str(caught.value)
    assert not controller.state.enabled


@pytest.mark.parametrize("includes_zeros", [True, False])
async def test_a_joint_that_moved_is_an_error(make, machine, includes_zeros) -> None:
    driver = make(joints_include_zeros=includes_zeros)
    await driver.open()
    await driver.prepare(ALL)
    machine.switch_on = lambda: setattr(machine, "_joints", (0.0, 0.0, 0.0, 6.8, 0.0, 0.0))
    if includes_zeros:  # it may report other joints where it stands
        await driver.reload(RESTARTED)
        return
    with pytest.raises(DeviceError, match=r"moved joint 4 by 6\.800 mm while it read its config again"):
        await driver.reload(RESTARTED)


async def test_nothing_is_reset_or_switched_on_without_permission(make, ready, controller) -> None:
    controller.state.set_machine(on=False)
    with pytest.raises(StartupNotPermitted, match="is switched off"):
        await ready.reload(RESTARTED)
    await ready.prepare(ALL)
    off = controller.state.set_machine
    controller.says["set machine off"] = lambda: (off(on=False), controller.state.set_estop(on=True))[-1]
    with pytest.raises(StartupNotPermitted, match=r"is in emergency stop$"):
        await ready.reload(RESTARTED)
    controller.state.set_estop(on=False)
    with pytest.raises(StartupNotPermitted, match="is switched off"):
        await ready.prepare(RESTARTED)


async def test_a_command_that_restarts_the_controller_is_waited_for(make, controller, tmp_path) -> None:
    mark = tmp_path / "restarting"
    driver = make(reload_command=("touch", str(mark)))
    await driver.open()
    await driver.prepare(ALL)
    state, refusals = controller.state, [Then.HANG_UP, Then.HANG_UP]

    def greets() -> Then | None:
        if not refusals:
            return None
        state.set_estop(on=True)
        state.homed = False
        return refusals.pop()

    controller.says["hello EMC"] = lambda: greets() if mark.exists() else None
    with pytest.raises(StartupNotPermitted, match="since it was started"):
        await driver.reload(frozenset({StartupAction.HOME}))
    await driver.prepare(ALL)
    refusals.append(Then.HANG_UP)
    await driver.reload(RESTARTED)
    await driver.move(TARGET, MOVE_S)
    controller.says["hello EMC"] = lambda: Then.HANG_UP
    with pytest.raises(ConnectionLost, match="closed the connection"):
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


async def test_a_reload_command_that_exceeds_its_time_or_is_cancelled_is_killed(tmp_path):
    with pytest.raises(DeviceError, match=r"took longer than 0\.3 s"):
        await run_reload_command(_saying_who(tmp_path), "controller", 0.3)
    if (tmp_path / "pid").exists():  # else it was killed before it could say
        _expect_gone(tmp_path)
        (tmp_path / "pid").unlink()
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
