"""Supervision of an action by the guards: its beginning, its end, and what must not trip."""

import asyncio
from typing import Any
from unittest.mock import AsyncMock

import pytest

from drivers.errors import WrongAnswer
from drivers.interfaces import GaugeReading
from hexacell.errors import DeviceError
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.limits.gauge_travel import GaugeRoom
from procedures.guards.polling import DevicePoller, LineActivity, PolledDevices
from procedures.guards.rules.base import GuardLimits
from procedures.guards.supervision import GuardMonitor
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.trips import Guard, GuardTripped
from procedures.steps import events
from procedures.steps.close import CloseSet
from procedures.steps.move import Expectation, Move
from procedures.steps.sample import Sample
from tests.waiting import cancel

LIMITS = GuardLimits(0.12, GaugeRoom.symmetric(5.5), Hexaglide.words)
P1 = SetKey(phase=Phase.IDENTIFY, point=1)
P2 = SetKey(phase=Phase.IDENTIFY, point=2)


def move(orientation: int, at: SetKey = P1, expected: Expectation | None = None) -> Move:
    x, y, z = (100.0, -100.0, 500.0) if at is P1 else (-100.0, 100.0, 500.0)
    pose = (x, y, z, orientation - 1.0, 0.0, 0.0)
    return Move(at=at, orientation=orientation, pose=pose, expected=expected)


def sample(orientation: int, at: SetKey = P1) -> Sample:
    return Sample(at=at, orientation=orientation, pose=move(orientation, at).pose)


@pytest.fixture
async def stage(scene: Any) -> Any:
    """A scene whose first reference is measured."""
    made = scene()
    for step in (move(1), sample(1)):
        await made.do(step)
    return made


async def test_two_complete_sets_trip_no_guard(scene) -> None:
    stage = scene()
    await stage.rig.performer.prepare(stage.state)
    for at in (P1, P2):
        for orientation in (1, 2, 3):
            await stage.do(move(orientation, at))
            await stage.do(sample(orientation, at))
        await stage.do(move(1, at))
        await stage.do(CloseSet(at=at))
    assert [len(stage.state.set(at).samples) for at in (P1, P2)] == [3, 3]
    assert stage.stops == 0


async def test_a_move_begins_after_every_device_has_answered(stage) -> None:
    begun: list[float] = []
    real = stage.controller.move

    async def late(pose: Any, duration_s: float) -> None:
        begun.append(stage.now)
        await real(pose, duration_s)

    stage.controller.move = late
    before = stage.now
    await stage.do(move(2))
    assert begun[0] - before >= 0.043 - 1e-9, "a gauge takes so long to answer"


@pytest.mark.parametrize("device", ["gauge y", "encoders", "controller"])
async def test_a_device_silent_before_a_move_prevents_the_move(stage, device: str) -> None:
    moves = stage.controller.log.count
    before = len(stage.controller.log)
    stage.silent.add(device)
    with pytest.raises(GuardTripped, match=device) as tripped:
        await stage.do(move(2))
    assert tripped.value.trip.guard is Guard.STALE
    assert moves("stop") == 0
    assert len(stage.controller.log) == before


async def test_a_trip_stays_latched_until_the_controller_is_prepared_again(stage) -> None:
    stage.forbidden = "the button is pressed"
    with pytest.raises(GuardTripped, match="the button"):
        await stage.do(move(2))
    with pytest.raises(GuardTripped, match="the button"):
        await stage.rig.performer.prepare(stage.state)
    stage.forbidden = None
    for step in (move(2), sample(1)):
        with pytest.raises(GuardTripped, match="the button"):
            await stage.do(step)
    await stage.rig.performer.prepare(stage.state)
    await stage.do(move(2))


async def test_a_robot_that_cannot_be_stopped_is_reported(stage) -> None:
    stage.controller.stop = AsyncMock(side_effect=DeviceError("does not answer", subject="controller"))
    moving = asyncio.ensure_future(stage.do(move(2)))
    await stage.rig.clock.sleep(0.3)
    stage.forbidden = "the button is pressed"
    with pytest.raises(GuardTripped, match=r"^PRESS THE EMERGENCY STOP\. .*\nstop line: .*the button"):
        await moving


async def test_a_failed_move_is_reported_as_the_trip_of_the_guard_with_its_cause(stage) -> None:
    async def interrupted(pose: Any, duration_s: float) -> None:
        stage.switch_off("joint 2 following error")
        raise DeviceError("stopped on the way", subject="controller")

    stage.controller.move = interrupted
    with pytest.raises(GuardTripped, match="joint 2 following error") as tripped:
        await stage.do(move(2))
    assert isinstance(tripped.value.__cause__, DeviceError)


async def test_a_move_that_fails_without_a_trip_or_by_a_programming_error_raises_that_error(stage) -> None:
    stage.controller.failures["move"] = DeviceError("cannot go there", subject="controller")
    with pytest.raises(DeviceError, match="cannot go there") as failed:
        await stage.do(move(2))
    assert not isinstance(failed.value, GuardTripped)
    await stage.do(move(2))
    stage.active_reason = AsyncMock(side_effect=ZeroDivisionError)
    with pytest.raises(ZeroDivisionError):
        await stage.do(move(2))


async def test_cancelling_ends_the_action_and_the_watch(stage) -> None:
    moving = asyncio.ensure_future(stage.do(move(2)))
    await stage.rig.clock.sleep(0.3)
    await cancel(moving)
    assert stage.rig.performer.guards.supervisor.latched is None


async def test_garbled_answers_on_a_noisy_line_trip_no_guard(stage) -> None:
    gauge = stage.rig.gauges[1]
    real, asked = gauge.read_once, [0]

    async def noisy() -> GaugeReading:
        asked[0] += 1
        await stage.rig.clock.sleep(0.1 if (asked[0] - 1) % 3 else 0.0)  # the line is left alone
        if asked[0] % 3:
            await stage.rig.clock.sleep(0.043)
            raise WrongAnswer("answers b'?'", subject="gauge y", action="Check it")
        return await real()  # type: ignore[no-any-return]

    gauge.read_once = noisy
    await stage.do(move(2))
    assert asked[0] > 3


async def test_gauges_are_not_read_during_a_move_to_another_point(stage) -> None:
    for gauge in stage.rig.gauges:
        gauge.read_once = AsyncMock(side_effect=AssertionError("its zero would be void"))
    await stage.do(move(1, P2))
    assert isinstance(await stage.do(sample(1, P2)), events.RecordTaken)


@pytest.mark.parametrize("from_elsewhere", [False, True])
async def test_gauges_are_not_monitored_on_the_return_from_elsewhere(stage, from_elsewhere: bool) -> None:
    """There a gauge may show something, and be at its end on the way."""
    back = move(2).model_copy(update={"from_elsewhere": from_elsewhere})
    moving = asyncio.ensure_future(stage.do(back))
    await stage.rig.clock.sleep(0.3)
    stage.at_end.add("x")
    if from_elsewhere:
        assert isinstance(await moving, events.Arrived)
        return
    with pytest.raises(GuardTripped, match="gauge x"):
        await moving


async def test_a_move_that_begins_at_the_end_of_a_plunger_may_lead_away_from_it(stage) -> None:
    stage.at_end.add("x")
    moving = asyncio.ensure_future(stage.do(move(2)))
    await stage.rig.clock.sleep(0.4)
    stage.at_end.clear()
    await moving


async def test_a_slider_away_from_its_commanded_position_trips_the_following_guard(stage) -> None:
    stage.slip_mm = -1.5
    with pytest.raises(GuardTripped, match=r"slider \d: is -1\.\d+ mm from its commanded") as tripped:
        await stage.do(move(2))
    assert tripped.value.trip.guard is Guard.FOLLOWING
    assert stage.stops == 1


EXPECTED = Expectation(deviation_mm=(0.0, 0.0, 3.0), sigma_mm=(0.1, 0.1, 0.1), gain=1.0)


@pytest.mark.parametrize(("sigma", "trips"), [(0.1, True), (0.5, False)])
async def test_a_gauge_that_does_not_change_during_a_move_trips_the_stale_guard(stage, sigma, trips):
    stage.frozen["z"] = stage.rig.gauges[2].shown()
    step = move(2, expected=EXPECTED.model_copy(update={"sigma_mm": (sigma,) * 3}))
    if not trips:
        await stage.do(step)
        return
    with pytest.raises(GuardTripped, match=r"gauge z: shows .* unchanged") as tripped:
        await stage.do(step)
    assert tripped.value.trip.guard is Guard.STALE


async def test_a_trip_is_journalled(scene) -> None:
    stage = scene()

    def press(event: events.Event, _: object) -> None:
        if isinstance(event, events.Arrived):
            stage.forbidden = "stop exists"

    with pytest.raises(GuardTripped):
        await stage.rig.run(press)
    history = read_journal(stage.rig.folder.journal)
    assert [event.kind for event in history[-2:]] == ["tripped", "interrupted"]
    assert history[-2].guard is Guard.STOP_LINE  # type: ignore[attr-defined]
    assert history[-1].exit_code == 3  # type: ignore[attr-defined]


async def test_devices_on_a_shared_line_are_not_silent_while_it_answers(scene) -> None:
    stage = scene()
    clock, shared = stage.rig.clock, LineActivity()
    turn = asyncio.Lock()

    async def queued() -> str:
        async with turn:
            await clock.sleep(0.05)
        return "here"

    pollers = tuple(DevicePoller("it", queued, shared) for _ in range(5))
    async with GuardMonitor(PolledDevices(gauges=pollers), LIMITS, clock) as monitor:  # type: ignore[arg-type]
        await clock.sleep(2.0)
        assert monitor.trip is None, "one answer in 0.25 s each, but one in 0.05 s altogether"


async def test_a_delay_of_the_process_is_no_silence_of_its_devices(scene) -> None:
    stage = scene()
    clock = stage.rig.clock

    async def slow() -> str:
        await clock.sleep(0.05)
        return ""

    pollers = PolledDevices(stop_input=DevicePoller("stop line", slow))
    async with GuardMonitor(pollers, LIMITS, clock) as monitor:
        await clock.sleep(0.2)
        clock.time_s += 5.0
        await clock.sleep(0.2)
        assert monitor.trip is None
