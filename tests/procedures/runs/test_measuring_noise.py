"""At the first reference a run measures the noise, once however often it is stopped, and uses it."""

import asyncio
from typing import Any

import numpy as np
import pytest

from drivers.errors import GaugeSilent
from hexacell.campaign import planner
from hexacell.campaign.pilots import FIRST_PILOT
from hexacell.cell.recovery import UnattendedRecovery
from hexacell.errors import Interruption
from hexacell.kinematics.pose import Pose
from procedures.engine.commands import Stop
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.assess_noise import AssessNoise
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.repeat import Repeat
from procedures.steps.standstill import Standstill
from procedures.workflow.sets import SetSteps
from tests.procedures.rig import MakeRig, Rig, new_rig
from tests.procedures.runs.listening import (
    ended_by_command,
    ended_by_power_cut,
    happened,
    on,
    run_until,
    steps_of,
)
from tests.small_cell import choose_among_few

P1 = SetKey(phase=Phase.IDENTIFY, point=1)
ASKED: dict[str, Any] = {"noise__standstill_readings": 16, "noise__revisits": 6}


@pytest.fixture
def asked(make_rig: MakeRig) -> Rig:
    return make_rig(**ASKED)


async def measure_noise(rig: Rig) -> events.NoiseMeasured:
    """Run until the noise is measured, and the set has one record more than its reference."""

    def listener(event: events.Event, state: RunState) -> None:
        if state.noise is not None and len(state.set(P1).samples) == 2:
            rig.engine.queue.put(Stop())

    with pytest.raises(Interruption):
        await rig.run(listener)
    (found,) = happened(rig, events.NoiseMeasured)
    assert isinstance(found, events.NoiseMeasured)
    return found


@pytest.fixture
def well_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot is known so well that no pilot poses are wanted."""
    monkeypatch.setattr(planner, "is_well_known", lambda *_: True)


async def test_it_is_read_at_rest_left_in_all_directions_and_evaluated(asked, well_known):
    await measure_noise(asked)
    steps = steps_of(asked)
    (first,) = (place for place, step in enumerate(steps) if isinstance(step, Standstill))
    (last,) = (place for place, step in enumerate(steps) if step == AssessNoise())
    reference = np.array(steps[first - 1].pose)
    between = steps[first + 1 : last]
    away, back, again = between[0::3], between[1::3], between[2::3]
    assert [type(step) for step in again] == [Repeat] * 6
    assert {(type(step), step.orientation) for step in away} == {(Move, 0)}
    assert {(type(step), step.orientation, step.pose) for step in back} == {(Move, 1, tuple(reference))}
    moved = np.array([np.array(step.pose) - reference for step in away])
    expected = np.concatenate([[[d, 0, 0], [-d, 0, 0]] for d in (1.5,)])
    assert moved[:2, :3] == pytest.approx(expected)
    assert np.linalg.norm(moved, axis=1) == pytest.approx(np.full(6, 1.5))
    assert np.linalg.matrix_rank(moved) == 3


async def test_it_is_measured_whatever_records_seem_to_show(asked, well_known, monkeypatch):
    as_drawn = SetSteps.is_clear_both_ways

    def none_as_shown(self: SetSteps, belief: Any, here: Any, there: Any, ball: Any) -> bool:
        return ball is None and as_drawn(self, belief, here, there, ball)

    monkeypatch.setattr(SetSteps, "is_clear_both_ways", none_as_shown)
    approaches = (await measure_noise(asked)).noise.approaches
    assert approaches is not None
    assert approaches.visits == 7


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> Rig:
    """A run that has just measured the noise, which is as small as stated."""
    with pytest.MonkeyPatch.context() as patch:
        choose_among_few(patch)
        rig = new_rig(tmp_path_factory.mktemp("quiet"), **ASKED)
        asyncio.run(measure_noise(rig))
    return rig


def test_the_reference_is_left_for_pilot_poses(quiet: Rig) -> None:
    """They are farther and farther away, stay inside the travel, and count for nothing."""
    pilots, visits = happened(quiet, events.PilotTaken), happened(quiet, events.ReferenceRepeated)
    assert [one.orientation for one in pilots] == [*range(FIRST_PILOT, FIRST_PILOT + len(pilots))]
    history = read_journal(quiet.folder.journal)
    kinds = [event.kind for event in history if event.kind in {"piloted", "repeated"}]
    departures = "".join("." if kind == "piloted" else " " for kind in kinds).removesuffix(" ").split(" ")
    assert departures == [*["..."] * 2, "", "", "", ""]
    reference = Pose(*happened(quiet, events.RecordTaken)[0].pose)
    turned = [reference.angle_to(Pose(*one.pose)) for one in pilots]
    assert np.mean(turned[3:]) > 2.0 * np.mean(turned[:3])
    state = fold(history)
    assert len(state.pilots) == len(pilots)
    travel = quiet.cell.settings.limits.gauge_travel_mm
    assert max(np.abs(one.deviation).max() for one in state.pilots) < travel
    assert {one.orientation for one in state.measurements().records} == {1, 2}
    assert len(visits) == 6


async def test_a_pilot_pose_outside_the_travel_is_the_last_one(asked: Rig) -> None:
    """The estimate is misled; the noise is measured all the same, and the point goes on."""
    shown, far = asked.gauges[0].shown, [0.0]
    asked.gauges[0].shown = lambda: shown() + far[0]

    def listener(event: events.Event, _: RunState) -> None:
        is_third = isinstance(event, events.StepBegun) and event.step.key == "P1/pilot03/pilot"
        far[0] = 20.0 if is_third else 0.0

    await run_until(asked, events.NoiseMeasured, listener)
    assert len(happened(asked, events.PilotTaken)) == 2
    assert len(happened(asked, events.ReferenceRepeated)) == 6


def test_the_quiet_simulation_is_as_noisy_as_stated(quiet: Rig) -> None:
    (measured,) = happened(quiet, events.NoiseMeasured)
    found = measured.noise
    assert not any(one.is_noisier for one in (*found.gauges, *found.encoders))
    assert {one.record for one in (*found.gauges, *found.encoders)} == {0.0012}
    readings = [one.reading or 1.0 for one in (*found.gauges, *found.encoders)]
    assert max(readings) < 0.0012
    assert found.approaches is not None
    assert found.approaches.visits == 7
    assert 0.4 < found.approaches.ratio < 1.5


async def test_encoders_that_show_other_places_each_time_are_told(make_rig: MakeRig) -> None:
    """The ball is where it was."""
    rig = make_rig(**ASKED)
    ball, shift = rig.physics.encoder_positions, np.zeros(6)
    random = np.random.default_rng(9)
    rig.bench.encoders.shown = lambda: [*(ball() + shift)]
    moved = on(
        events.Arrived, lambda: shift.__setitem__(slice(None), 0.03 * random.standard_normal(6)), None
    )
    await run_until(rig, events.NoiseMeasured, moved)
    (found,) = happened(rig, events.NoiseMeasured)
    assert len(happened(rig, events.PilotTaken)) == 6, "until three visits show it"
    assert found.noise.approaches.source == "encoders"
    assert found.noise.approaches.excess == pytest.approx(0.03, rel=0.6)
    informed = rig.calibration.known(fold(read_journal(rig.folder.journal)))
    assert informed.settings.uncertainty == rig.cell.settings.uncertainty
    assert informed.robot.noise.encoders == pytest.approx(np.full(6, 0.03), rel=0.6)
    assert informed.robot.noise.gauges_mm == pytest.approx(np.full(3, 0.0012))


AVERAGED = ASKED | {
    "identification__target_mm": 1e-4,
    "simulation__gauges__flicker_mm": 0.01,
    "simulation__encoders__flicker": 0.01,
    "noise__encoder": 0.002,
    "noise__gauge_mm": 0.002,
}


async def test_records_are_means_of_several_windows_where_that_is_needed_and_pays(make_rig, well_known):
    rig = make_rig(**AVERAGED)
    found = await measure_noise(rig)
    assert found.noise.windows == 4
    single, zero, second = happened(rig, events.RecordTaken)[:3]
    assert (single.orientation, zero.orientation, second.orientation) == (1, 1, 2)
    assert zero.deviation_mm == (0.0, 0.0, 0.0)
    assert len(zero.reading.counts) == len(second.reading.counts) == 4 * len(single.reading.counts)
    state = fold(read_journal(rig.folder.journal))
    assert state.set(P1).samples[:2] == (zero, second)
    noise = rig.calibration.known(state).robot_of(state).noise
    assert noise.encoder < 0.85 * 0.0045


@pytest.mark.parametrize(
    ("end", "step"),
    [
        (ended_by_command, 56),
        *(pytest.param(one, 3, marks=pytest.mark.slow) for one in (ended_by_command, ended_by_power_cut)),
    ],
)
async def test_interrupted_anywhere_it_is_measured_once(make_rig, few_candidates, tmp_path, end, step):
    """After a stop, and after a death that leaves no word, at some events until the noise is measured."""
    for number in range(step, 80, 2 * step):
        folder = tmp_path / f"{number}"
        folder.mkdir()
        rig = new_rig(folder, **ASKED)
        assert await end(rig, number)
        await measure_noise(rig)
        state = fold(read_journal(rig.folder.journal))
        assert len(state.set(P1).samples) == 2
        assert state.noise is not None
        assert state.noise.noise.approaches is not None
        assert state.noise.noise.approaches.visits == 7


FAILING = (Standstill, Pilot, Repeat)


@pytest.mark.sample("redo-set-Repeat")
@pytest.mark.parametrize("kind", FAILING)
@pytest.mark.parametrize("action", ["retry", "measure-again", "redo-set"])
async def test_a_device_that_fails_meanwhile_costs_no_more_than_its_recovery(asked, kind, action):
    """A gauge is silent once while the noise is measured."""
    silent = GaugeSilent("does not answer", subject="gauge y")

    def fail(event: events.Event, state: RunState) -> None:
        if isinstance(event, events.StepBegun) and isinstance(event.step, kind) and not state.failures:
            asked.gauges[1].failures.append(silent)
        if state.noise is not None and len(state.set(P1).samples) == 2:
            asked.engine.queue.put(Stop())

    escalations = UnattendedRecovery.model_validate({"gauge_silent": (action, "abort")})
    with pytest.raises(Interruption):
        await asked.run(fail, policy=escalations)
    (failure,) = happened(asked, events.Failed)
    assert isinstance(failure.step, kind)
    (found,) = happened(asked, events.NoiseMeasured)
    assert found.noise.approaches.visits == 7
    state = fold(read_journal(asked.folder.journal))
    is_lost = action != "retry" and kind is not Standstill  # a gauge that is opened again has lost its zero
    assert len(happened(asked, events.StandstillRead)) == (2 if is_lost else 1)
    assert len(state.set(P1).visits) == 6


@pytest.mark.parametrize("revisits", [0, 1])
async def test_a_run_that_visits_its_reference_hardly_ends_with_a_verdict(make_rig, revisits) -> None:
    """Readings at rest alone are no repeats."""
    rig = make_rig(noise__standstill_readings=16, noise__revisits=revisits)
    await rig.run()
    assert len(happened(rig, events.NoiseMeasured)) == 1
    (judged,) = happened(rig, events.ResultValidated)
    assert np.isfinite(judged.verification.accuracy.position.expanded)
