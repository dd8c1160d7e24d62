"""A length check finds a scale error, and tells whatever goes wrong between the seats."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.devices import ThermometerSettings
from hexacell.cell.loader import load_cell
from hexacell.errors import AnswerNeeded, HexacellError
from hexacell.results.result import AcceptedResult
from hexacell.verdict.decision import Verdict
from hexacell.verdict.length_check import LengthStatement
from procedures.calibration.calibration import Mode, expected_records
from procedures.devices.device_set import Thermometers
from procedures.engine.commands import MeasureAgain
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import GaugePlacement, Question
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.workflow.length import BESIDE_MM
from procedures.workflow.preflight import plan_failures
from tests.procedures.fakes import Approver, FakeThermometer
from tests.procedures.rig import Rig
from tests.procedures.runs.listening import happened

RECORDS = 6
MOUNTINGS = [SetKey(phase=Phase.LENGTH, point=number) for number in (1, 2, 3)]
ACCEPTED = AcceptedResult(
    run="runs/before",
    at=datetime(2026, 11, 20, tzinfo=UTC),
    covariance=tuple(map(tuple, (1e-5 * np.eye(42)).tolist())),
)


@pytest.fixture
def make_length_rig(make_rig):
    """A machine that is as its controller has it, by encoders that are ``long_um_m`` long."""
    drawn = load_cell(bundled_config("simulated-hexaglide")).settings.robot.nominal

    def make(operator: Any = None, long_um_m: float = 0.0, **changes: Any) -> Rig:
        shown_per_mm = 1.0 + 1e-6 * long_um_m
        true = {kind: (np.array(values) / shown_per_mm).tolist() for kind, values in drawn}
        changes |= {
            "simulation__geometry": type(drawn).model_validate(true),
            "simulation__encoders__common_scale_um_m": long_um_m,
        }
        rig: Rig = make_rig(Mode.LENGTH, operator, ACCEPTED, **changes)
        return rig

    return make


async def stated(rig: Rig, *listeners: Any) -> LengthStatement:
    await rig.run(*listeners)
    found: LengthStatement = rig.engine.state.judged.length
    return found


@pytest.mark.parametrize("long_um_m", [1000.0, -400.0])
async def test_a_scale_of_all_encoders_is_found(make_length_rig, long_um_m: float) -> None:
    rig = make_length_rig(long_um_m=long_um_m)
    found = await stated(rig)
    assert found.result.long_um_m == pytest.approx(long_um_m, abs=found.result.expanded_um_m)
    assert found.result.is_significant
    assert found.error is not None
    assert found.error.value == pytest.approx(1.9e-4 * abs(long_um_m), rel=0.3)
    assert found.verdict is Verdict.PASS  # of this cell, whose limit is 5 mm


async def test_true_encoders_pass_after_three_mountings_and_nothing_is_written(make_length_rig) -> None:
    rig = make_length_rig()
    before = rig.config
    told: list[Any] = []
    found = await stated(rig, lambda event, _: told.append(event))
    assert found.verdict is Verdict.PASS
    assert abs(found.result.long_um_m) <= found.result.expanded_um_m < 30.0
    assert found.error is not None
    assert found.error.value + (found.error.expanded or 1.0) < 0.02
    assert rig.config == before
    assert "reload" not in rig.controller.log
    samples = [event for event in told if isinstance(event, events.RecordTaken)]
    assert [event.at for event in told if isinstance(event, events.SetClosed)] == MOUNTINGS
    assert [(s.at, s.orientation) for s in samples] == [
        (key, number) for key in MOUNTINGS for number in range(1, RECORDS + 1)
    ]
    first, second = (np.array([s.pose for s in samples if s.at == key]) for key in MOUNTINGS[:2])
    assert first[0] == pytest.approx([-150.0, 0.0, 500.0, 0.0, 0.0, 0.0])
    assert first[1, :3] - first[0, :3] == pytest.approx(BESIDE_MM)
    assert np.hypot(first[2:, 3], first[2:, 4]) == pytest.approx(10.0)
    # In the second seat the record beside its middle comes first, and the rest where the gauges show zero.
    assert second[0, :3] == pytest.approx(np.array([150.0, 0.0, 500.0]) + BESIDE_MM)
    middle = [s.deviation_mm for s in samples if s.at == MOUNTINGS[1] and s.orientation > 1]
    assert np.abs(middle).max() < 0.02
    assert expected_records(rig.cell.settings, Mode.LENGTH) == len(samples) + len(MOUNTINGS)


async def test_a_fixture_beside_its_direction_is_found_by_the_first_reading(make_length_rig) -> None:
    """Half a degree: the second seat is 2.6 mm off, and the ball goes there."""
    rig = make_length_rig(simulation__fixture__yaw_deg=0.5)
    found = await stated(rig)
    assert found.verdict is Verdict.PASS
    assert abs(found.result.long_um_m) <= found.result.expanded_um_m
    samples = rig.engine.state.set(MOUNTINGS[1]).samples
    assert np.abs(samples[0].deviation_mm).max() > 2.0
    assert np.abs([sample.deviation_mm for sample in samples[1:]]).max() < 0.1


async def test_a_warm_fixture_is_longer_by_its_expansion(make_length_rig) -> None:
    """4 K of steel are 46 um/m: the true distance of the seats is that of the warm fixture."""
    longer = 300.0 * (1.0 + 4 * 11.5e-6)
    rig = make_length_rig(
        thermometers=(ThermometerSettings(name="fixture", path="/nowhere"),),
        length_check__thermometer="fixture",
        simulation__fixture__distance_mm=longer,
    )
    rig.performer = replace(rig.performer, thermometers=Thermometers([FakeThermometer("fixture", 24.0)]))
    found = await stated(rig)
    assert found.result.distance_mm == pytest.approx(longer)
    assert abs(found.result.long_um_m) <= found.result.expanded_um_m < 40.0


async def test_gauges_the_wrong_way_round_in_the_second_seat_are_told(make_length_rig) -> None:
    found = await stated(make_length_rig(simulation__fixture__turned_deg=180.0))
    assert found.verdict is Verdict.NOT_EVALUATED
    assert "at mounting 2 gauge x and y run against the ball" in found.result.reason
    assert "the wrong way round in their seat" in found.result.reason


async def test_a_ball_outside_the_travel_in_the_second_seat_is_told_with_what_to_check(make_length_rig):
    rig = make_length_rig(simulation__fixture__yaw_deg=2.0)
    with pytest.raises(HexacellError, match="L2: the ball left the gauges' travel in seat 2") as failure:
        await rig.run()
    assert "Check first_seat, direction and distance_mm in [length_check]" in str(failure.value)
    assert rig.engine.state.set(MOUNTINGS[0]).closed


class LeavesBefore(Approver):
    """A person who goes home before a mounting."""

    def __init__(self, mounting: int) -> None:
        super().__init__()
        self.mounting: int | None = mounting

    async def ask(self, question: Question) -> str | None:
        match question.subject:
            case GaugePlacement(point=point, seat=int()) if point == self.mounting:
                raise AnswerNeeded("nobody is there")
        return await super().ask(question)


def killed(rig: Rig) -> None:
    """The journal of a run that had no time to note its end."""
    lines = rig.folder.journal.read_bytes().splitlines(keepends=True)
    assert b'"kind":"interrupted"' in lines[-1]
    rig.folder.journal.write_bytes(b"".join(lines[:-1]))


@pytest.mark.sample("2-True", "3-False")
@pytest.mark.parametrize("is_killed", [False, True])
@pytest.mark.parametrize("mounting", [2, 3])
async def test_a_check_resumed_between_the_seats_goes_on_there(make_length_rig, mounting, is_killed):
    person = LeavesBefore(mounting)
    rig = make_length_rig(person, length_check__mounting="by-hand")
    with pytest.raises(AnswerNeeded):
        await rig.run()
    if is_killed:
        killed(rig)
    person.mounting = None
    found = await stated(rig)
    assert found.verdict is Verdict.PASS
    assert person.placed == [1, 2, 3]


async def test_a_mounting_that_is_measured_again_takes_all_with_it(make_length_rig) -> None:
    """The others have the zero of the first, which is in doubt."""
    rig = make_length_rig()
    asked: list[Any] = []

    def again(event: Any, _: RunState) -> None:
        if isinstance(event, events.RecordTaken) and event.at == MOUNTINGS[1] and not asked:
            asked.append(event)
            rig.engine.queue.put(MeasureAgain(MOUNTINGS[1]))

    found = await stated(rig, again)
    assert found.verdict is Verdict.PASS
    placed = [event.at.point for event in happened(rig, events.GaugesPlaced)]
    assert placed == [1, 2, 1, 2, 3]


def test_the_first_mounting_has_the_zero_of_all(story) -> None:
    first, second = story(Phase.LENGTH, 1), story(Phase.LENGTH, 2)
    state = fold([*first.whole(2), *second.whole(2)])
    assert state.zero(MOUNTINGS[1]) == state.set(MOUNTINGS[0]).samples[0].reading
    assert state.open_sets == []
    assert state.sets_with_zero == [MOUNTINGS[0]]


async def test_nobody_mounts_the_gauges_of_an_unattended_check(make_length_rig) -> None:
    calibration = make_length_rig(length_check__mounting="by-hand").calibration
    (failure,) = await plan_failures(calibration, unattended=True)
    assert "mounted in the two seats by hand" in str(failure)
    assert await plan_failures(calibration, unattended=False) == []
    assert await plan_failures(make_length_rig().calibration, unattended=True) == []


async def test_a_seat_out_of_reach_is_told_before_anything_moves(make_length_rig) -> None:
    calibration = make_length_rig(length_check__first_seat=(-500.0, 0.0, 500.0)).calibration
    failures = await plan_failures(calibration, unattended=True)
    assert failures
    assert all("length check, seat " in str(failure) for failure in failures)


async def test_gauges_mounted_the_wrong_way_round_are_named_at_once(make_length_rig) -> None:
    fixture = {"simulation__fixture__turned_deg": 180.0}
    rig = make_length_rig(stations__trial_mm=1.0, **fixture)
    with pytest.raises(HexacellError, match="gauges x, y: count the wrong way"):
        await rig.run()
    history = read_journal(rig.folder.journal)
    assert {event.at for event in history if isinstance(event, events.RecordTaken)} == set(MOUNTINGS[:2])
