"""Preflight reports all failures at once, and the robot does not move."""

import asyncio
import re
from collections.abc import Callable

import pytest

from drivers.errors import GaugeSilent, GaugeUnsteady, NotHomedError
from hexacell.campaign import feasibility
from hexacell.errors import AnswerNeeded, DeviceError, ExitCode, ReachError, SeveralErrors
from procedures.workflow.preflight import device_failures, plan_failures, raise_all

FAR = (0.0, 0.0, 2000.0)


async def failures(rig, *, unattended: bool = True) -> list[str]:
    return [str(error) for error in await plan_failures(rig.calibration, unattended=unattended)]


async def test_every_point_out_of_reach_or_range_or_next_to_a_singularity_is_named(make_rig) -> None:
    good = (100.0, -100.0, 500.0)
    rig = make_rig(identification__points=(good, FAR, FAR), verification__points=(FAR, good))
    far = await plan_failures(rig.calibration, unattended=True)
    names = ["identification point 2", "identification point 3", "verification point 1"]
    assert [error.subject for error in far] == names
    assert all(isinstance(error, ReachError) and "leg 1" in str(error) for error in far)
    found = await failures(make_rig(limits__joint_min=-480.0, limits__joint_max=480.0))
    assert found
    # The controller's config has the other end.
    assert all(re.search("mm, outside (-480 to 200|-200 to 480)", problem) for problem in found)
    assert any(problem.startswith("identification point 1: q") for problem in found)
    found = await failures(make_rig(limits__singularity_margin=0.5))
    assert len(found) == 4
    assert all("singularity margin is 0.1" in problem and "below 0.5" in problem for problem in found)


async def test_too_few_records_are_refused_before_they_are_measured(make_rig) -> None:
    two_points = ((0.0, 0.0, 550.0), (100.0, -100.0, 500.0))
    assert await failures(make_rig(identification__points=two_points, identification__orientations=7)) == []
    (found,) = await failures(make_rig(identification__points=two_points, identification__orientations=6))
    assert "2 points with 6 orientations give 30 equations for 35 parameters. Have at least 7 " in found


async def test_gauges_carried_by_hand_need_a_person(make_rig) -> None:
    rig = make_rig(stations__placement="by-hand", identification__points=((100.0, -100.0, 500.0), FAR))
    assert await failures(rig, unattended=False) == (await failures(rig))[:1]
    alone = await plan_failures(rig.calibration, unattended=True)
    assert [type(error) for error in alone] == [ReachError, AnswerNeeded]


def stopped_in_its_first_call(work: Callable[..., object], calls: list[object]) -> Callable[..., object]:
    """``work`` that notes its calls, and during whose first one the present task is told to stop."""
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    assert task is not None

    def working(*arguments: object) -> object:
        if not calls:
            loop.call_soon_threadsafe(task.cancel)
        calls.append(arguments)
        return work(*arguments)

    return working


@pytest.mark.parametrize("piece", ["reach_failures", "_no_safe_pose"])
async def test_a_cancelled_plan_check_ends_before_its_next_part(make_rig, monkeypatch, piece) -> None:
    """A whole check takes longer than a stop is allowed to take."""
    rig = make_rig()
    calls: list[object] = []
    monkeypatch.setattr(feasibility, piece, stopped_in_its_first_call(getattr(feasibility, piece), calls))
    monkeypatch.setattr(feasibility, "_no_better", lambda _plan: pytest.fail("the check went on"))
    with pytest.raises(asyncio.CancelledError):
        await plan_failures(rig.calibration, unattended=True)
    assert len(calls) == 1


async def test_every_device_that_does_not_answer_is_named_and_nothing_is_asked_to_move(bench) -> None:
    assert await device_failures(bench.devices) == []
    bench.gauges[0].failures = [GaugeSilent("does not answer", subject="gauge x")]
    bench.gauges[2].failures = [GaugeUnsteady("readings do not agree", subject="gauge z")]
    bench.encoders.failure = DeviceError("no round", subject="encoders")
    found = await device_failures(bench.devices)
    assert [error.subject for error in found] == ["gauge x", "gauge z", "encoders"]
    assert bench.controller.log == []


async def test_a_gauge_away_from_the_ball_and_joints_that_are_not_homed_are_no_failures(bench) -> None:
    bench.gauges[1].shown = lambda: 12.0
    bench.encoders.failure = NotHomedError("are not homed", subject="encoders")
    assert await device_failures(bench.devices) == []
    bench.encoders.failure = DeviceError("no round", subject="encoders")
    assert [error.subject for error in await device_failures(bench.devices)] == ["encoders"]


def test_one_failure_is_raised_as_it_is_and_several_in_one_report() -> None:
    raise_all([])
    with pytest.raises(ReachError):
        raise_all([ReachError("too far")])
    errors = [ReachError("too far"), DeviceError("dead"), AnswerNeeded("nobody")]
    with pytest.raises(SeveralErrors, match=r"(?s)3 problems .*too far.*dead.*nobody") as refusal:
        raise_all([*errors])
    assert refusal.value.exit_code is ExitCode.HARDWARE
