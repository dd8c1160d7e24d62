"""Before motion everything that stands in the way is said at once, and nothing moves."""

from __future__ import annotations

import pytest

from drivers.gauges.errors import GaugeSilent, GaugeUnsteady
from hexacell.errors import AnswerNeeded, DeviceError, ExitCode, ReachError, SeveralErrors
from procedures.preflight import device_failures, plan_failures, raise_all

FAR = (0.0, 0.0, 2000.0)


def failures(rig, *, unattended: bool = True) -> list[str]:
    return [str(error) for error in plan_failures(rig.calibration, unattended=unattended)]


def test_a_good_plan_has_no_failures(make_rig) -> None:
    assert failures(make_rig()) == []


def test_every_point_out_of_reach_is_named_with_its_leg(make_rig) -> None:
    good = (100.0, -100.0, 500.0)
    rig = make_rig(identification__points=(good, FAR, FAR), verification__points=(FAR, good))
    found = list(plan_failures(rig.calibration, unattended=True))
    names = ["identification point 2", "identification point 3", "verification point 1"]
    assert [error.subject for error in found] == names
    assert all(isinstance(error, ReachError) and "leg 1" in str(error) for error in found)


def test_a_point_outside_the_joint_range_is_named_with_its_joint(make_rig) -> None:
    found = failures(make_rig(limits__joint_min_mm=-480.0, limits__joint_max_mm=480.0))
    assert found
    assert all("mm, outside -480 to 480" in problem for problem in found)
    assert any(problem.startswith("identification point 1: q") for problem in found)


def test_a_point_next_to_a_singularity_is_named(make_rig) -> None:
    found = failures(make_rig(limits__singularity_margin=0.5))
    assert len(found) == 4
    assert all("singularity margin is 0.1" in problem and "below 0.5" in problem for problem in found)


def test_too_few_records_are_refused_before_they_are_measured(make_rig) -> None:
    two_points = ((0.0, 0.0, 550.0), (100.0, -100.0, 500.0))
    assert failures(make_rig(identification__points=two_points, identification__orientations=7)) == []
    (found,) = failures(make_rig(identification__points=two_points, identification__orientations=6))
    assert found == (
        "[identification]: 2 points with 6 orientations give 30 equations for 35 parameters. "
        "Have at least 7 orientations at each point"
    )


def test_gauges_carried_by_hand_need_a_person(make_rig) -> None:
    rig = make_rig(stations__placement="by-hand", identification__points=((100.0, -100.0, 500.0), FAR))
    assert failures(rig, unattended=False) == failures(rig)[:1]
    alone = list(plan_failures(rig.calibration, unattended=True))
    assert [type(error) for error in alone] == [ReachError, AnswerNeeded]


async def test_devices_that_answer_are_fine_and_nothing_is_asked_to_move(bench) -> None:
    assert await device_failures(bench.devices) == []
    assert bench.controller.log == []


async def test_every_device_that_does_not_answer_is_named(bench) -> None:
    bench.gauges[0].failures = [GaugeSilent("does not answer", subject="gauge x")]
    bench.gauges[2].failures = [GaugeUnsteady("readings do not agree", subject="gauge z")]
    bench.encoders.failure = DeviceError("no round", subject="encoders")
    found = await device_failures(bench.devices)
    assert [error.subject for error in found] == ["gauge x", "gauge z", "encoders"]


async def test_a_gauge_away_from_the_ball_is_no_failure(bench) -> None:
    bench.gauges[1].shown = lambda: 12.0
    assert await device_failures(bench.devices) == []
    bench.encoders.failure = DeviceError("no round", subject="encoders")
    assert [error.subject for error in await device_failures(bench.devices)] == ["encoders"]


def test_nothing_to_raise() -> None:
    raise_all([])


def test_one_failure_is_raised_as_it_is() -> None:
    with pytest.raises(ReachError):
        raise_all([ReachError("too far")])


def test_several_are_raised_in_one_report() -> None:
    errors = [ReachError("too far"), DeviceError("dead"), AnswerNeeded("nobody")]
    with pytest.raises(SeveralErrors, match=r"(?s)3 things .*too far.*dead.*nobody") as refusal:
        raise_all([*errors])
    assert refusal.value.worst is ExitCode.HARDWARE
