"""Moves and stops: the end is verified by the position, and a refusal is reported with its reason."""

import asyncio
from collections.abc import Callable

import pytest

from drivers.controllers.linuxcnc.shell_connection import Connection
from drivers.errors import ConnectionLost, MotionInterrupted, MoveRefused, PoseRefused
from hexacell.errors import DeviceError
from tests.drivers.controllers.linuxcnc.conftest import (
    ALL,
    AWAY,
    LONG_S,
    MOVE_S,
    TARGET,
    UNREACHABLE,
    Then,
    once,
)
from tests.waiting import cancel, until

NAK = b"SET MDI NAK\n\r"
MOVE = "set mdi G21 G53 G93 G1"


def at(pose: str) -> bytes:
    return f"ABS_ACT_POS {pose}\r\n".encode()


async def begun(driver, machine, duration_s=LONG_S):
    """A move that is on its way."""
    before = machine.events.count("move")
    moving = asyncio.create_task(driver.move(TARGET, duration_s))
    await until(lambda: machine.events.count("move") > before)
    return moving


@pytest.mark.parametrize("waits", [True, False])
async def test_a_move_ends_at_its_pose_whenever_it_is_acknowledged(ready, controller, waits) -> None:
    """``set_wait received`` of another client is global in 2.9; a computer under load does likewise."""
    controller.state.waits = waits
    for pose in (TARGET, AWAY):
        await ready.move(pose, 0.2)
        assert (await ready.position()).pose == pose


@pytest.mark.parametrize(
    ("there", "arrives"),
    [
        ("10.009 20 560 5.009 -4 363", True),
        ("10 20.011 560 5 -4 3", False),
        ("10 20 560 5 -4.011 3", False),
    ],
)
async def test_an_acknowledgement_is_not_an_arrival(ready, controller, there, arrives) -> None:
    controller.says["get abs_act_pos"] = lambda: at(there) if controller.count(MOVE) else None
    if arrives:
        await ready.move(TARGET, MOVE_S)
        return
    once_said = _iterated(b"ERROR joint 2 following error\r\n", b"ERROR OK\r\n")
    controller.says["get error"] = lambda: once_said() if controller.count(MOVE) else None
    with pytest.raises(MotionInterrupted, match=r"before reaching X10\.000 Y20\.000 Z560") as caught:
        await ready.move(TARGET, MOVE_S)
    assert "joint 2 following error" in caught.value.problem


def _iterated(*answers: bytes) -> Callable[[], bytes]:
    left = list(answers)
    return lambda: left.pop(0) if len(left) > 1 else left[0]


@pytest.mark.parametrize(
    ("ends", "why"),
    [
        (lambda state: state.set_estop(on=True), "it is in emergency stop"),
        (lambda state: state.set_machine(on=False), "it is switched off"),
        (lambda state: state.exceed_following_error(), "joint 3 following error"),
        (lambda state: state.abort(), "it is on, and gives no reason"),
    ],
)
async def test_a_move_that_somebody_ends_is_reported_with_its_reason(
    ready, machine, controller, ends, why
) -> None:
    moving = await begun(ready, machine)
    ends(controller.state)
    with pytest.raises(MotionInterrupted, match=f"stopped at X.* before reaching X10.*: {why}"):
        await moving
    with pytest.raises(MoveRefused, match="its last move failed"):
        await ready.move(TARGET, MOVE_S)


async def test_a_refused_pose_reports_all_messages_once(ready, controller) -> None:
    for _ in range(2):
        with pytest.raises(PoseRefused, match="fails kinematicsInverse; invalid params in linear command"):
            await ready.move(UNREACHABLE, MOVE_S)
    controller.says |= {"get error": b"ERROR emc_error: bad status from EMC\r\n", "set mdi": NAK}
    with pytest.raises(MoveRefused, match=r": emc_error: bad status from EMC$"):
        await ready.move(TARGET, MOVE_S)


async def test_control_is_not_retaken_from_another_client(ready, make, controller) -> None:
    before = controller.count("set enable")
    controller.state.commander = object()
    for reason in ("another client has taken control of it", "its last move failed"):
        with pytest.raises(MoveRefused, match=reason):
            await ready.move(TARGET, MOVE_S)
    assert controller.count("set enable") == before
    await ready.prepare(ALL)
    controller.state.commander = object()
    await ready.prepare(ALL)
    await ready.move(TARGET, MOVE_S)


async def test_a_move_that_exceeds_its_time_is_stopped(ready, machine) -> None:
    machine.move = lambda pose, _duration, move=machine.move: move(pose, LONG_S)
    with pytest.raises(MotionInterrupted, match=r"still moving after 0\.32 s and was stopped"):
        await ready.move(TARGET, 0.01)
    here = await ready.position()
    assert await ready.position() == here


@pytest.mark.parametrize("is_reached", [True, False])
async def test_a_connection_lost_in_a_move_stops_it_or_asks_for_the_emergency_stop(
    ready, machine, controller, is_reached
) -> None:
    moving = await begun(ready, machine)
    if is_reached:
        controller._cut_all()
    else:
        controller.set_unplugged(on=True)
    words = "closed the connection" if is_reached else r"could not be stopped: it closed .*emergency stop"
    with pytest.raises(ConnectionLost if is_reached else DeviceError, match=words):
        await moving
    if not is_reached:
        return
    assert not controller.state.is_moving
    with pytest.raises(DeviceError, match="Prepare it again"):
        await ready.move(TARGET, MOVE_S)
    await ready.prepare(ALL)
    await ready.move(TARGET, MOVE_S)


async def test_an_inch_machine_is_commanded_in_mm_and_what_it_tells_is_converted(make, controller) -> None:
    controller.settings = controller.settings.model_copy(update={"unit_mm": 25.4})
    driver = make(unit_mm=25.4)
    await driver.open()
    await driver.prepare(ALL)
    controller.says["get program_codes"] = b"PROGRAM_CODES G0 G17 G20 G90 G94 G54 G49 F0 S0\r\n"
    await driver.move(TARGET, MOVE_S)
    reported = await driver.position()
    assert controller.count("set mdi G20 G94 G0") == 1
    assert reported.pose.as_tuple() == pytest.approx(TARGET.as_tuple(), abs=2e-5)
    assert reported.joints == pytest.approx(TARGET.as_tuple(), abs=1e-4)


@pytest.mark.parametrize(
    ("codes", "block"), [("G1 G17 G21 G90 G94 F250", "G94 G1 F250"), ("G80 G17 G21 G90 G94 F0", "G94 G80")]
)
async def test_the_modes_are_restored_after_a_move_and_after_one_that_was_stopped(
    ready, machine, controller, codes, block
) -> None:
    controller.says["get program_codes"] = f"PROGRAM_CODES {codes}\r\n".encode()
    await ready.move(AWAY, MOVE_S)
    assert controller.count(f"set mdi {block}") == 1
    moving = await begun(ready, machine)
    await ready.stop()
    with pytest.raises(MotionInterrupted, match="stopped on request"):
        await moving
    assert controller.count(f"set mdi {block}") == 2
    controller.says[f"set mdi {block}"] = NAK
    await ready.move(TARGET, MOVE_S)
    controller.says = {}
    await ready.move(AWAY, MOVE_S)
    assert controller.count(f"set mdi {block}") == 4, "those that could not be restored then"


async def test_a_cancelled_move_is_stopped_and_its_late_answer_discarded(
    ready, machine, controller
) -> None:
    await cancel(await begun(ready, machine))
    assert not controller.state.is_moving
    await ready.move(TARGET, MOVE_S)
    controller.set_unplugged(on=True)
    moving = asyncio.create_task(ready.move(AWAY, LONG_S))
    await asyncio.sleep(0)
    await cancel(moving)


async def test_a_stop_is_refused_while_it_is_off_and_repeated_while_it_moves(
    driver, ready, machine, controller
):
    controller.state.set_machine(on=False)
    await driver.stop()
    await driver.prepare(ALL)
    moving = await begun(driver, machine)
    stops: list[int] = []
    machine.stop = lambda stop=machine.stop: stops.append(1) if len(stops) < 2 else stop()
    del stops[:]
    await driver.stop()
    with pytest.raises(MotionInterrupted):
        await moving
    assert controller.count("set abort") >= 3
    assert not controller.state.is_moving


async def test_a_machine_that_does_not_stop_is_reported(ready, machine, controller) -> None:
    moving = await begun(ready, machine)
    stop, machine.stop = machine.stop, lambda: None
    with pytest.raises(
        DeviceError, match=r"could not be stopped: it .* still moves 0\.3 s after .*Press the em"
    ):
        await ready.stop()
    machine.stop = stop
    with pytest.raises(DeviceError):
        await moving
    with pytest.raises(MoveRefused, match=r"could not be stopped|Prepare it again"):
        await ready.move(AWAY, MOVE_S)


@pytest.mark.parametrize("what", ["hello EMC", "set enable", "set abort"])
async def test_a_stop_finds_another_way_where_an_answer_does_not_come(
    ready, machine, controller, what
) -> None:
    moving = await begun(ready, machine)
    await ready.status()
    controller.says[what] = once(Then.SAY_NOTHING)
    if what == "hello EMC":
        controller.says["set abort"] = once(Then.HANG_UP)
    await ready.stop()
    assert not controller.state.is_moving
    with pytest.raises(DeviceError):
        await moving


async def test_a_stop_does_not_wait_for_a_query(ready, machine, controller) -> None:
    moving = await begun(ready, machine)
    controller.says["get estop"] = once(Then.SAY_NOTHING)
    asking = asyncio.create_task(ready.status())
    await until(lambda: controller.lines[-1] == "get estop")
    await ready.stop()
    assert not controller.state.is_moving
    for task in (asking, moving):
        with pytest.raises(DeviceError):
            await task


async def test_two_commands_are_never_sent_at_once(make, machine, monkeypatch) -> None:
    """LinuxCNC 2.9 garbles commands of two clients that coincide."""
    lines, write = set(), Connection._write

    def watched(connection: Connection, data: bytes) -> None:
        assert connection._line.locked()
        lines.add(connection._line)
        write(connection, data)

    monkeypatch.setattr(Connection, "_write", watched)
    driver = make()
    await driver.open()
    await driver.prepare(ALL)
    moving = await begun(driver, machine)
    await driver.stop()
    with pytest.raises(MotionInterrupted):
        await moving
    assert len(lines) == 1
