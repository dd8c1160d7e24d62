"""Steps and events are data: stable names, and the same after a way through JSON."""

from __future__ import annotations

from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from drivers.interfaces import DeviceIdentity
from hexacell.campaign.pilots import FIRST_PILOT
from hexacell.cell.recovery import Action, FailureKind
from hexacell.config.interface import ControllerLimits
from hexacell.identification.solver.result import DataFaultKind
from hexacell.kinematics.parameters import JointUnit
from hexacell.noise.approach_scatter import RepeatedApproaches, ScatterSource
from hexacell.noise.measured_noise import (
    AveragingForecast,
    InstrumentNoise,
    MeasuredNoise,
)
from hexacell.results.result import OutlierRecord
from hexacell.verdict.acceptance_gates import AcceptanceGate
from hexacell.verdict.decision import JudgedError, Verdict, VerifiedAccuracy
from hexacell.verdict.model_evidence import ModelTest
from hexacell.verdict.verification import Verification
from procedures.journal.journal import Journal, read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.readings import Reading
from procedures.run.trips import Guard
from procedures.steps import events
from procedures.steps.accept import Accept
from procedures.steps.assess_noise import AssessNoise
from procedures.steps.close import CloseSet
from procedures.steps.commit import Commit
from procedures.steps.events import EVENTS
from procedures.steps.identify import Identify
from procedures.steps.judge import Judge
from procedures.steps.locate import Locate
from procedures.steps.move import Expectation, Move
from procedures.steps.pilot import Pilot
from procedures.steps.place import Place
from procedures.steps.probe import Probe
from procedures.steps.propose import Propose
from procedures.steps.registry import Step
from procedures.steps.repeat import Repeat
from procedures.steps.revisit import Revisit
from procedures.steps.roll_back import RollBack
from procedures.steps.sample import Sample
from procedures.steps.standstill import Standstill
from procedures.steps.try_gauges import Try
from tests.procedures.identified import an_identification

POSE = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
P2 = SetKey(phase=Phase.IDENTIFY, point=2)


@pytest.mark.parametrize(
    ("step", "key"),
    [
        (Move(at=P2, orientation=7, pose=POSE), "P2/o07/move"),
        (Place(at=P2, pose=POSE), "P2/place"),
        (Sample(at=P2, orientation=7, pose=POSE), "P2/o07/sample"),
        (Sample(at=P2, orientation=11, pose=POSE), "P2/o11/sample"),
        (CloseSet(at=P2), "P2/close"),
        (Sample(at=SetKey(phase=Phase.BEFORE, point=1), orientation=2, pose=POSE), "before-V1/o02/sample"),
        (Move(at=SetKey(phase=Phase.AFTER, point=12), orientation=1, pose=POSE), "after-V12/o01/move"),
        (Standstill(at=P2), "P2/standstill"),
        (Pilot(at=P2, orientation=FIRST_PILOT + 2, pose=POSE), "P2/pilot03/pilot"),
        (Move(at=P2, orientation=FIRST_PILOT, pose=POSE), "P2/pilot01/move"),
        (Repeat(at=P2), "P2/repeat"),
        (Probe(at=P2, moved_mm=(1.0, 0.0, 0.0)), "P2/probe"),
        (Try(at=P2), "P2/try"),
        (AssessNoise(), "assess noise"),
        (Identify(), "identify"),
        (RollBack(), "roll back"),
    ],
)
def test_keys_are_stable(step: Any, key: str) -> None:
    assert step.key == key


def test_the_target_of_a_move_is_its_pose() -> None:
    assert Move(at=P2, orientation=1, pose=POSE).target.as_tuple() == POSE


def test_steps_do_not_change() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        setattr(CloseSet(at=P2), "at", P2)  # noqa: B010 - not even so


def test_unknown_keys_are_refused() -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(Step).validate_python({"kind": "close", "at": {"phase": "P", "point": 1}, "why": 1})


number = st.floats(allow_nan=False, allow_infinity=False)
three = st.tuples(number, number, number)
six = st.tuples(*[number] * 6)
text = st.text(max_size=12)
count = st.integers(1, 99)
set_key = st.builds(SetKey, phase=st.sampled_from(Phase), point=count)
expectation = st.builds(Expectation, deviation_mm=three, sigma_mm=three, gain=number)
some_step: st.SearchStrategy[Any] = st.one_of(
    st.builds(Move, at=set_key, orientation=count, pose=six, expected=st.none() | expectation),
    st.builds(Locate),
    st.builds(Place, at=set_key, pose=six),
    st.builds(Sample, at=set_key, orientation=count, pose=six),
    st.builds(Revisit, at=set_key),
    st.builds(CloseSet, at=set_key),
    st.sampled_from([AssessNoise(), Identify(), Propose(), Commit(), Judge(), Accept(), RollBack()]),
    st.builds(Standstill, at=set_key),
    st.builds(Repeat, at=set_key),
    st.builds(Probe, at=set_key, moved_mm=st.tuples(*[number] * 3)),
    st.builds(Try, at=set_key),
)
reading = st.builds(
    Reading,
    gauges_mm=three,
    spread_mm=three,
    joints=six,
    answers=st.lists(st.tuples(text, text, text), max_size=2).map(tuple),
    counts=st.lists(st.tuples(*[st.integers()] * 6), max_size=2).map(tuple),
    skews_s=st.lists(number, max_size=2).map(tuple),
)
geometry = st.fixed_dictionaries(
    {
        "S": st.tuples(*[three] * 6),
        "B": st.tuples(*[three] * 6),
        "l": st.tuples(*[st.floats(1, 1e4)] * 6),
    }
)
gate = st.builds(AcceptanceGate, name=text, passed=st.booleans(), sentence=text, needs_person=st.booleans())
judged_error = st.builds(
    JudgedError, value=number, expanded=number, limit=number, verdict=st.sampled_from(Verdict)
)
verification = st.builds(
    Verification,
    verdict=st.sampled_from(Verdict),
    tests=st.lists(
        st.builds(
            ModelTest,
            name=text,
            passed=st.booleans(),
            sentence=text,
            probability=st.none() | st.floats(0.0, 1.0),
        ),
        max_size=2,
    ).map(tuple),
    accuracy=st.none()
    | st.builds(
        VerifiedAccuracy,
        position=judged_error,
        orientation=judged_error,
        poses=count,
        task_named=st.booleans(),
        worst=six,
    ),
    before_mm=st.none() | number,
    after_mm=st.none() | number,
    is_worse=st.booleans(),
)
outlier = st.builds(
    OutlierRecord,
    point=count,
    orientation=count,
    kind=st.sampled_from(DataFaultKind),
    gauges=st.lists(st.sampled_from("xyz"), max_size=3).map(tuple),
    off_mm=st.none() | three,
)
instrument = st.builds(
    InstrumentNoise,
    name=text,
    unit=st.sampled_from(JointUnit),
    reading=st.none() | number,
    degrees_of_freedom=count,
    drift=number,
    stated=number,
    is_noisier=st.booleans(),
    record=number,
)
measured_noise = st.builds(
    MeasuredNoise,
    gauges=st.tuples(instrument, instrument, instrument),
    encoders=st.lists(instrument, max_size=2).map(tuple),
    approaches=st.none()
    | st.builds(
        RepeatedApproaches,
        visits=count,
        degrees_of_freedom=count,
        ball_mm=number,
        ratio=number,
        source=st.none() | st.sampled_from(ScatterSource),
        unit=st.sampled_from(JointUnit),
        excess=number,
    ),
    windows=count,
    forecasts=st.lists(
        st.builds(AveragingForecast, windows=count, error_mm=number, minutes=number), max_size=2
    ).map(tuple),
    encoders_part_mm=st.none() | number,
)
some_event: st.SearchStrategy[Any] = st.one_of(
    st.builds(
        events.RunStarted,
        software=text,
        cell=text,
        cell_text=text,
        mode=st.sampled_from(["check", "optimise"]),
        config=text,
        config_sha256=text,
        controller=geometry,
        branch=st.tuples(*[st.sampled_from([-1, 1])] * 6),
        devices=st.lists(
            st.builds(DeviceIdentity, name=text, protocol=text, description=text), max_size=2
        ).map(tuple),
        taught=geometry,
        joint_ranges=st.just(((0.0, 1.0),) * 6),
        limits=st.just(ControllerLimits()),
    ),
    st.builds(events.StepBegun, step=some_step),
    st.builds(events.Arrived, at=set_key, orientation=count, pose=six),
    st.builds(events.Located, pose=six, joints=st.none() | six, encoders=six),
    st.builds(
        events.PoseExcluded,
        at=set_key,
        orientation=count,
        pose=six,
        reason=text,
        axis=st.none() | st.sampled_from("xyzabc"),
        is_highest=st.booleans(),
    ),
    st.builds(events.GaugesPlaced, at=set_key),
    st.builds(
        events.RecordTaken, at=set_key, orientation=count, pose=six, reading=reading, deviation_mm=three
    ),
    st.builds(events.RecordRejected, at=set_key, orientation=count, reason=text),
    st.builds(events.RecordDiscarded, at=set_key, orientation=count),
    st.builds(events.ReferenceConfirmed, at=set_key, change_mm=three, reading=reading),
    st.builds(
        events.StandstillRead,
        at=set_key,
        gauges_mm=st.lists(three, max_size=2).map(tuple),
        joints=st.lists(six, max_size=2).map(tuple),
        skews_s=st.lists(number, max_size=2).map(tuple),
        answers=st.lists(st.tuples(text, text, text), max_size=2).map(tuple),
        counts=st.lists(st.tuples(*[st.integers()] * 6), max_size=2).map(tuple),
    ),
    st.builds(events.ReferenceRepeated, at=set_key, reading=reading),
    st.builds(events.GaugesProbed, at=set_key, moved_mm=st.tuples(*[number] * 3), reading=reading),
    st.builds(events.GaugesTried, at=set_key, response=st.tuples(*[st.tuples(*[number] * 3)] * 3)),
    st.builds(events.NoiseMeasured, at=set_key, noise=measured_noise),
    st.builds(events.SetClosed, at=set_key, drift_mm=three, reading=reading),
    st.builds(events.SetInvalidated, at=set_key, reason=text),
    st.builds(
        events.Identified,
        result=st.builds(
            an_identification,
            converged=st.booleans(),
            chi2=number,
            covariance=st.lists(st.lists(number, max_size=2).map(tuple), max_size=2).map(tuple),
            undetermined=st.lists(text, max_size=2).map(tuple),
            outliers=st.lists(outlier, max_size=2).map(tuple),
            frame=text,
        ),
        held_out=st.lists(st.lists(six, max_size=2).map(tuple), max_size=2).map(tuple),
        held_out_after=st.lists(st.lists(six, max_size=2).map(tuple), max_size=2).map(tuple),
    ),
    st.builds(events.Proposed, gates=st.lists(gate, max_size=3).map(tuple), written=geometry),
    st.builds(events.Committed, approved_by=text),
    st.builds(
        events.ConfirmationPlanned,
        reason=text,
        poses=st.lists(st.lists(six, max_size=2).map(tuple), max_size=2).map(tuple),
    ),
    st.builds(
        events.ResultValidated,
        verdict=st.sampled_from(Verdict),
        line=text,
        verification=st.none() | verification,
    ),
    st.builds(events.ResultAccepted, by=st.none() | text, asked=st.booleans()),
    st.builds(events.RolledBack),
    st.builds(events.Paused, at_once=st.booleans()),
    st.builds(events.Resumed),
    st.builds(events.RunRecalled, reason=text),
    st.builds(
        events.Failed,
        step=st.none() | some_step,
        failure=st.sampled_from(FailureKind),
        attempt=count,
        reason=text,
        action=st.sampled_from(Action),
        asked=st.booleans(),
    ),
    st.builds(events.CommandRejected, command=text, reason=text),
    st.builds(events.Tripped, guard=st.sampled_from(Guard), device=text, problem=text, action=text),
    st.builds(events.Interrupted, reason=text, exit_code=st.integers(0, 255)),
    st.builds(events.Ended, exit_code=st.integers(0, 255), line=text),
)


@given(some_step)
def test_steps_survive_json(step: Any) -> None:
    adapter: TypeAdapter[Step] = TypeAdapter(Step)
    assert adapter.validate_json(adapter.dump_json(step)) == step


@settings(max_examples=25)  # each forces every event to the disk
@given(history=st.lists(some_event, max_size=4))
def test_events_survive_the_journal(history: list[events.Event], tmp_path_factory: Any) -> None:
    path = tmp_path_factory.mktemp("journal") / "journal.jsonl"
    with Journal(path) as journal:
        for event in history:
            journal.append(event)
    assert read_journal(path) == tuple(history)


def test_kinds_of_events_are_different_and_never_change() -> None:
    assert set(EVENTS) == set(get_args(get_args(events.Event)[0]))
    names = [kind.model_fields["kind"].default for kind in EVENTS]
    assert len(set(names)) == len(names)
    assert set(names) == set(KINDS)


KINDS = (
    *("started", "begun", "arrived", "placed", "sampled", "refused", "closed", "voided", "identified"),
    *("lent", "taken back", "proposed", "committed", "judged", "rolled back", "interrupted", "ended"),
    *("located", "undone", "confirmed", "paused", "resumed", "failed", "declined", "tripped"),
    *("accepted", "stood", "repeated", "probed", "tried", "noise measured", "excluded", "recalled"),
    *("confirmation planned", "piloted"),
)
"""Journals on disk say these words: they must never change."""
