"""Doing a step: what is read becomes a record on the base's axes, or a refusal with its reason."""

from typing import Any

import numpy as np
import pytest

from drivers.errors import GaugeAtEnd, GaugeSilent, ZeroVoid
from hexacell.cell.devices import GaugeAxis
from hexacell.errors import LimitError, SeveralErrors
from procedures.devices.device_set import Devices, MountedGauge
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.close import CloseSet
from procedures.steps.sample import Sample

P1 = SetKey(phase=Phase.IDENTIFY, point=1)
POSE = (100.0, -100.0, 500.0, 0.0, 0.0, 0.0)
SAMPLE = Sample(at=P1, orientation=1, pose=POSE)
SECOND = Sample(at=P1, orientation=2, pose=POSE)


class Station:
    """A rig whose gauges and sliders show what is put in front of them."""

    def __init__(self, rig: Any) -> None:
        self.rig = rig
        self.shown = [0.0, 0.0, 0.0]
        for place, gauge in enumerate(rig.gauges):
            gauge.shown = lambda place=place: self.shown[place]
        rig.bench.encoders.shown = lambda: (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)

    def mount(self, *axes_and_signs: tuple[int, int]) -> None:
        mounted = zip(self.rig.gauges, axes_and_signs, strict=True)
        gauges = tuple(MountedGauge(gauge, GaugeAxis(axis, sign)) for gauge, (axis, sign) in mounted)
        devices = Devices(gauges, self.rig.bench.encoders, self.rig.controller)
        object.__setattr__(self.rig.performer, "devices", devices)

    async def do(self, step: Any, state: RunState | None = None) -> Any:
        return await self.rig.performer.perform(step, state or RunState())


@pytest.fixture
def station(make_rig) -> Station:
    """Its sliders show what they are told to, and its gauges may stand anywhere."""
    return Station(make_rig(guards__following=1e6, stations__mounting_mm=4.0))


@pytest.fixture
async def zeroed(station: Station) -> RunState:
    """A set with its reference taken at -1, 2 and 3 mm."""
    station.shown[:] = [-1.0, 2.0, 3.0]
    station.rig.bench.encoders.shown = lambda: (0.0,) * 6
    return fold([await station.do(SAMPLE)])


async def test_the_first_record_of_a_set_is_the_zero_and_the_raw_answers_are_kept_in_their_order(station):
    station.shown[:] = [-1.0, 2.0, 3.0]
    event = await station.do(SAMPLE)
    assert isinstance(event, events.RecordTaken)
    assert event.deviation_mm == (0.0, 0.0, 0.0)
    assert event.reading.gauges_mm == (-1.0, 2.0, 3.0)
    assert event.reading.joints == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    station.shown[:] = [-0.5, 1.75, 3.0]
    event = await station.do(SECOND, fold([event]))
    assert event.deviation_mm == (0.5, -0.25, 0.0)
    assert event.reading.gauges_mm == (-0.5, 1.75, 3.0)
    station.shown[:] = [-1.0, 2.0, 3.0]
    reading = (await station.do(SAMPLE)).reading
    assert set(reading.answers) == {("-1.000", "+2.000", "+3.000")}
    assert set(reading.counts) == {(1000, 2000, 3000, 4000, 5000, 6000)}
    assert len(reading.answers) == len(reading.counts) == len(reading.skews_s) >= 5
    assert all(skew_s >= 0.0 for skew_s in reading.skews_s)


MOUNTINGS = [
    (((0, 1), (1, 1), (2, 1)), (1.0, 2.0, 3.0)),
    (((0, -1), (1, 1), (2, -1)), (-1.0, 2.0, -3.0)),
    (((2, 1), (0, 1), (1, 1)), (2.0, 3.0, 1.0)),
    (((1, -1), (2, -1), (0, 1)), (3.0, -1.0, -2.0)),
]


@pytest.mark.parametrize(("mounting", "expected"), MOUNTINGS)
async def test_gauges_are_turned_onto_the_bases_axes(station, mounting, expected):
    station.mount(*mounting)
    zero = fold([await station.do(SAMPLE)])
    station.shown[:] = [1.0, 2.0, 3.0]
    event = await station.do(SECOND, zero)
    assert event.deviation_mm == expected


async def test_ranges_are_turned_too_and_stay_positive(station: Station) -> None:
    station.mount((2, -1), (0, 1), (1, 1))
    values = iter(np.tile([0.0, 0.03125], 50).tolist())
    station.rig.gauges[0].shown = values.__next__
    assert (await station.do(SAMPLE)).reading.spread_mm == (0.0, 0.0, 0.03125)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("deviation", [-5.001, 5.001])
async def test_a_ball_outside_the_travel_is_refused(station: Station, axis: int, deviation: float) -> None:
    zero = fold([await station.do(SAMPLE)])
    station.shown[axis] = round(deviation)
    assert isinstance(await station.do(SECOND, zero), events.RecordTaken), "the limit is included"
    station.shown[axis] = deviation
    event = await station.do(SECOND, zero)
    assert isinstance(event, events.RecordRejected)
    assert f"{'xyz'[axis]} {deviation:+.3f}" in event.reason
    assert "farther than 5 mm" in event.reason
    assert (event.at, event.orientation) == (P1, 2)


async def test_gauges_at_their_ends_are_a_refusal_that_names_all(station, zeroed):
    station.shown[2] = 7.0
    reason = "gauge z: is at an end of its travel"
    assert await station.do(SECOND, zeroed) == events.RecordRejected(at=P1, orientation=2, reason=reason)
    station.shown[:] = [7.0, 0.0, -7.0]
    event = await station.do(SECOND, zeroed)
    assert isinstance(event, events.RecordRejected)
    assert "gauge x" in event.reason
    assert "gauge z" in event.reason


@pytest.mark.parametrize(
    "errors",
    [
        [GaugeSilent("does not answer", subject="gauge x")],
        [GaugeSilent("does not answer", subject="gauge x"), GaugeAtEnd("at an end", subject="gauge y")],
    ],
)
async def test_other_failures_are_no_refusals(station, zeroed, errors):
    for gauge, error in zip(station.rig.gauges, errors, strict=False):
        gauge.failures = [error]
    with pytest.raises(GaugeSilent if len(errors) == 1 else SeveralErrors):
        await station.do(SECOND, zeroed)


async def test_a_drift_within_the_limit_closes_the_set(station: Station, zeroed: RunState) -> None:
    station.shown[:] = [-1.0625, 2.0, 3.09375]
    event = await station.do(CloseSet(at=P1), zeroed)
    assert isinstance(event, events.SetClosed)
    assert event.reading is not None
    assert event.reading.gauges_mm == (-1.0625, 2.0, 3.09375)
    assert event.drift_mm == (-0.0625, 0.0, 0.09375)


@pytest.mark.parametrize(("axis", "drift"), [(0, 0.11), (1, -0.11), (2, 0.5)])
async def test_a_reference_that_drifted_is_not_closed(station, zeroed, axis, drift):
    station.shown[axis] += drift
    with pytest.raises(LimitError, match=r"P1: back at the reference .*more than 0\.1 mm") as refusal:
        await station.do(CloseSet(at=P1), zeroed)
    assert f"{'xyz'[axis]} {drift:+.3f}" in str(refusal.value)


async def test_a_gauge_that_was_set_differently_voids_the_set(station: Station, zeroed: RunState) -> None:
    station.rig.gauges[1].void = ZeroVoid("was set differently", subject="gauge y")
    with pytest.raises(ZeroVoid, match="gauge y"):
        await station.do(CloseSet(at=P1), zeroed)
    station.rig.gauges[2].void = ZeroVoid("was off", subject="gauge z")
    with pytest.raises(SeveralErrors, match=r"(?s)gauge y.*gauge z"):
        await station.do(CloseSet(at=P1), zeroed)
