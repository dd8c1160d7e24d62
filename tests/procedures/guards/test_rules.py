"""Each guard applied to a snapshot: no trip without a fault, otherwise a problem and an action."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import GaugeAtEnd, GaugeSilent, WrongAnswer, ZeroVoid
from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.errors import DeviceError, ExitCode, LimitError
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.limits.gauge_travel import GaugeRoom
from hexacell.noise.allowances import ReferenceChange
from procedures.guards.polling import DevicePoller, GaugeDeviation, LineActivity, PolledDevices
from procedures.guards.rules import first_trip
from procedures.guards.rules.after_a_move import following_error, stuck_gauge
from procedures.guards.rules.base import GuardLimits
from procedures.guards.supervision import low_disk_space
from procedures.run.trips import DriftTripped, Guard, GuardTripped, Trip
from procedures.steps import events
from procedures.steps.close import reference_drift

PLATE = GaugeRoom.symmetric(5.5)
LIMITS = GuardLimits(0.12, PLATE, Hexaglide.words)
AT_END = GaugeAtEnd("plunger at its end", subject="gauge x", action="Move the gauge or the ball")


async def unread() -> Any:
    raise NotImplementedError


def polled(device: str, silent_s: float = 0.0, **changes: Any) -> DevicePoller[Any]:
    return DevicePoller(device, unread, LineActivity(silent_s), **changes)


def gauge(now: float | None = 0.0, first: float | None = 0.0, axis: int = 0, **changes: Any) -> Any:
    def seen(deviation: float | None) -> GaugeDeviation | None:
        return None if deviation is None else GaugeDeviation(axis, deviation)

    return polled(f"gauge {'xyz'[axis]}", value=seen(now), first=seen(first), **changes)


def sliders(now: tuple[float, ...], first: tuple[float, ...] = (0.0,) * 6) -> Any:
    def taken(positions: tuple[float, ...]) -> EncoderSample:
        return EncoderSample((0,) * 6, positions)

    return polled("encoders", value=taken(now), first=taken(first))


def status(*messages: str, estop: bool = False, enabled: bool = True) -> Any:
    return polled("controller", value=ControllerStatus(estop, enabled, messages))


WELL = PolledDevices(
    gauges=(gauge(axis=0), gauge(5.5, axis=1), gauge(-5.5, axis=2)),
    encoders=sliders((100.0,) * 6),
    controller=status(),
    stop_input=polled("stop line", value=""),
)


def tripped(limits: GuardLimits = LIMITS, **changes: Any) -> Trip:
    trip = first_trip(replace(WELL, **changes), limits)
    assert trip is not None
    return trip


ALARM = DeviceError("reports no magnet", subject="leg 3", action="Look at it")


@pytest.mark.parametrize(
    ("changes", "guard", "device", "words"),
    [
        ({"stop_input": polled("stop line", value="/stop exists")}, Guard.STOP_LINE, "stop line", "exists"),
        ({"encoders": polled("encoders", error=ALARM)}, Guard.ENCODERS, "leg 3", "reports no magnet"),
        ({"gauges": (gauge(4.0, error=AT_END),)}, Guard.GAUGE_END, "gauge x", "plunger at its end"),
        *(
            ({"controller": status(*said, estop=estop, enabled=enabled)}, guard, "controller", words)
            for said, estop, enabled, guard, words in [
                ((), True, False, Guard.EMERGENCY_STOP, "is in emergency stop"),
                ((), True, True, Guard.EMERGENCY_STOP, "is in emergency stop"),
                ((), False, False, Guard.CONTROLLER, "was switched off"),
                (("too hot",), False, False, Guard.CONTROLLER, "was switched off: too hot"),
                (("a", "Joint 0 Following Error"), False, False, Guard.FOLLOWING, "Following Error"),
            ]
        ),
    ],
)
def test_a_fault_trips_its_guard_with_device_and_reason(changes, guard, device, words) -> None:
    trip = tripped(**changes)
    assert (trip.guard, trip.device) == (guard, device)
    assert words in trip.problem
    assert trip.action


@pytest.mark.parametrize(
    "harmless",
    [
        WELL,
        PolledDevices(),
        PolledDevices(
            (polled("gauge x"),), polled("encoders"), polled("controller"), polled("stop line")
        ),  # without an answer yet
        PolledDevices(controller=status("joint 3 following error")),  # it is enabled
        PolledDevices((gauge(None, None, error=AT_END),)),  # a plunger at its end may leave it
    ],
)
def test_a_snapshot_without_a_fault_trips_no_guard(harmless: PolledDevices) -> None:
    assert first_trip(harmless, LIMITS) is None


def test_the_ball_may_go_as_far_as_each_side_has_room() -> None:
    limits = GuardLimits(0.12, GaugeRoom((-5.0, -5.0, -5.0), (1.2, 5.0, 5.0)), Hexaglide.words)
    assert first_trip(PolledDevices((gauge(-4.9, 0.0, 0),)), limits) is None
    assert first_trip(PolledDevices((gauge(4.9, 0.0, 1),)), limits) is None
    trip = first_trip(PolledDevices((gauge(1.3, 0.0, 0),)), limits)
    assert trip is not None
    assert "+1.30 mm from its reference along x, farther than 1.20 mm" in trip.problem


@given(deviation=st.floats(-20.0, 20.0), first=st.floats(-20.0, 20.0), axis=st.sampled_from([0, 1, 2]))
def test_a_ball_must_not_go_farther_than_allowed_nor_than_it_was(deviation, first, axis):
    trip = first_trip(PolledDevices((gauge(deviation, first, axis),)), LIMITS)
    if abs(deviation) > max(5.5, abs(first)):
        assert trip is not None
        assert (trip.guard, trip.device) == (Guard.PLATE, f"gauge {'xyz'[axis]}")
        assert f"{deviation:+.2f} mm from its reference along {'xyz'[axis]}" in trip.problem
    else:
        assert trip is None


@given(leg=st.integers(0, 5), way=st.floats(-3.0, 3.0))
def test_a_slider_that_moves_at_standstill_trips_the_following_guard(leg: int, way: float) -> None:
    now = [10.0] * 6
    now[leg] += way
    snapshot = PolledDevices(encoders=sliders(tuple(now), (10.0,) * 6))
    assert first_trip(snapshot, LIMITS) is None, "a robot that moves may"
    trip = first_trip(snapshot, GuardLimits(0.12, PLATE, Hexaglide.words, 1.0))
    if abs(now[leg] - 10.0) > 1.0:
        assert trip is not None
        assert (trip.guard, trip.device) == (Guard.FOLLOWING, f"slider {leg + 1}")
    else:
        assert trip is None


def test_devices_that_fail_are_all_named() -> None:
    void = ZeroVoid("was off", subject="gauge x", action="Zero it")
    silent = GaugeSilent("does not answer", subject="gauge z", action="Switch it on")
    trip = tripped(gauges=(gauge(error=void), gauge(axis=1), gauge(axis=2, error=silent)))
    assert trip.guard is Guard.DEVICE
    assert str(trip.as_error()) == "gauge x: was off; gauge z: does not answer. Zero it. Switch it on"


@pytest.mark.parametrize(("garbled", "trips"), [(1, False), (2, False), (3, True), (4, True)])
def test_a_device_trips_only_after_three_garbled_answers(garbled: int, trips: bool) -> None:
    nonsense = WrongAnswer("answers b'0'", subject="gauge y", action="Check it")
    snapshot = PolledDevices((gauge(axis=1, error=nonsense, garbled_count=garbled),))
    trip = first_trip(snapshot, LIMITS)
    assert (trip is not None and trip.guard is Guard.DEVICE) is trips


@pytest.mark.parametrize("device", ["gauges", "encoders", "controller", "stop_input"])
def test_any_device_silent_beyond_the_limit_trips_the_stale_guard(device: str) -> None:
    def snapshot(silent_s: float) -> PolledDevices:
        heard: Any = polled("it", silent_s)
        only: dict[str, Any] = {device: (heard,) if device == "gauges" else heard}
        return PolledDevices(**only)

    assert first_trip(snapshot(0.12), LIMITS) is None
    trip = first_trip(snapshot(0.121), LIMITS)
    assert trip is not None
    assert (trip.guard, trip.device) == (Guard.STALE, "it")


def test_the_trip_of_a_cause_precedes_those_of_its_effects() -> None:
    everything: dict[str, Any] = {
        "gauges": (gauge(9.0, error=AT_END, silent_s=1.0),),
        "encoders": polled("encoders", error=DeviceError("has an alarm"), silent_s=1.0),
        "controller": status(estop=True, enabled=False),
        "stop_input": polled("stop line", value="active_reason"),
    }
    order = []
    for key in ("stop_input", "controller", "encoders", "gauges"):
        order.append(tripped(**everything).guard)
        everything[key] = getattr(WELL, key)
    assert order == [Guard.STOP_LINE, Guard.EMERGENCY_STOP, Guard.ENCODERS, Guard.GAUGE_END]
    assert first_trip(PolledDevices(**everything), LIMITS) is None


def test_a_slider_beyond_the_following_limit_is_named() -> None:
    sent = np.arange(6.0)
    assert following_error(sent, sent + 1.0, 1.0, Hexaglide.words) is None
    measured = sent + np.array([0.0, 0.5, 0.0, 0.0, -1.25, 1.0])
    trip = following_error(sent, measured, 1.0, Hexaglide.words)
    assert trip is not None
    assert (trip.guard, trip.device) == (Guard.FOLLOWING, "slider 5")
    assert "is -1.250 mm from its commanded position (limit 1 mm)" in trip.problem


@pytest.mark.parametrize(
    ("shown", "expected_mm", "trips"),
    [
        (("+1.234",) * 3, 1.5, True),
        (("+1.234",) * 3, -1.5, True),
        (("+1.234",) * 3, 0.5, False),
        (("+1.234",) * 2, 1.5, False),
        (("+1.234", "+1.234", "+1.235"), 1.5, False),
        ((), 1.5, False),
    ],
)
def test_an_unchanged_gauge_trips_if_the_ball_should_have_moved(shown, expected_mm, trips):
    trip = stuck_gauge("gauge y", shown, expected_mm)
    assert (trip is not None) is trips
    if trip:
        assert f"+1.234 unchanged although the ball should have moved {expected_mm:+.2f}" in trip.problem


def test_drift_has_its_own_exit_code() -> None:
    def change(*unexplained: float, explicable: float = 0.0) -> ReferenceChange:
        shown = np.array(unexplained), np.eye(3), np.zeros((3, 3)), np.full(3, explicable)
        return ReferenceChange(*shown, joints=np.zeros(6), explicable_joints=0.0)

    assert reference_drift("P2", change(0.1, -0.1, 0.0), 0.1) is None
    assert reference_drift("P2", change(0.0, -0.3, 0.0, explicable=0.4), 0.1) is None
    trip = reference_drift("P2", change(0.0, -0.101, 0.0), 0.1)
    assert trip is not None
    error = trip.as_error()
    assert isinstance(error, DriftTripped)
    assert isinstance(error, LimitError)
    assert error.exit_code is ExitCode.OUT_OF_LIMITS


@pytest.mark.parametrize(("free", "trips"), [(50_000_000, False), (49_999_999, True), (0, True)])
def test_the_disk_must_have_room(monkeypatch, free: int, trips: bool) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=free))
    assert (low_disk_space(Path("/runs"), 50.0) is not None) is trips


def test_a_trip_without_a_stop_asks_for_the_emergency_stop_first() -> None:
    trip = Trip(
        Guard.STALE, "controller", "has not answered", "Check its cable", stop_failure="no way to it"
    )
    error = trip.as_error()
    assert isinstance(error, GuardTripped)
    assert error.exit_code is ExitCode.HARDWARE
    first, then = str(error).splitlines()
    assert first.startswith("PRESS THE EMERGENCY STOP. The robot could not be stopped")
    assert first.endswith(": no way to it")
    assert then == "controller: has not answered. Check its cable"
    told = events.Tripped.of(error.trip)
    assert told.problem == "the robot could not be stopped: no way to it. Before that: has not answered"
    assert told.action == "Press the emergency stop"
