"""A test of the model that fails narrowly asks for new records, which alone tell whether by chance."""

from typing import Any

import pytest

from hexacell.errors import ExitCode
from hexacell.kinematics.pose import Pose
from hexacell.noise import repeats
from hexacell.verdict import model_evidence
from hexacell.verdict.decision import Verdict
from procedures.calibration.held_out_poses import HeldOutPoses
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.move import Move
from tests.procedures.fakes import refused
from tests.procedures.runs.listening import PowerCut, happened

FIRST = SetKey(phase=Phase.CONFIRM, point=1)


@pytest.fixture(autouse=True)
def test_that_fails_narrowly(monkeypatch: pytest.MonkeyPatch) -> None:
    """No healthy run passes the test of its held-out records."""
    monkeypatch.setattr(model_evidence, "SMALLEST_PROBABILITY", 1.0)


async def test_confirming_records_that_agree_end_the_run_with_a_pass(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    (planned,) = happened(rig, events.ConfirmationPlanned)
    assert planned.reason.startswith("The held-out records are ")
    state = fold(read_journal(rig.folder.journal))
    assert [len(poses) for poses in planned.poses] == [3, 3]
    assert [sample.pose for sample in state.samples(Phase.CONFIRM)] == [
        pose for poses in planned.poses for pose in poses
    ]
    phases = (Phase.IDENTIFY, Phase.BEFORE, Phase.AFTER)
    earlier = {sample.pose for phase in phases for sample in state.samples(phase)}
    assert not set(planned.poses[0][1:]) & earlier, "they are new ones"
    assert state.judged is not None
    assert state.judged.verdict is Verdict.PASS
    verification = state.judged.verification
    assert verification is not None
    assert verification.tests[-1].name == "confirming records"
    assert all(test.passed for test in verification.tests)
    assert any(test.sentence.endswith("new records do not confirm that.") for test in verification.tests)
    assert rig.config == recording.config_after


@pytest.mark.parametrize(
    ("where", "name", "value", "planned"),
    [
        pytest.param(model_evidence, "CONFIRMING_PROBABILITY", 1.0, 1, id="new records do not agree"),
        pytest.param(model_evidence, "BEYOND_CHANCE", 1.0, 0, id="beyond chance"),
        pytest.param(HeldOutPoses, "confirming", lambda *_: ((), ()), 0, id="no pose can be taken"),
    ],
)
async def test_a_failure_that_is_not_explained_leaves_the_result_not_evaluated(
    recording, replayed, monkeypatch, where, name, value, planned
):
    monkeypatch.setattr(where, name, value)
    rig = replayed(recording.until(events.Proposed))
    rig.operator.name = None
    ended = await rig.run()
    assert len(happened(rig, events.ConfirmationPlanned)) == planned
    assert happened(rig, events.ResultValidated)[0].verdict is Verdict.NOT_EVALUATED
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert rig.config == recording.config_before


@pytest.mark.slow
async def test_a_run_asks_the_held_out_records_about_scatter_that_chance_may_show(make_rig, monkeypatch):
    monkeypatch.setattr(model_evidence, "CONFIRMING_PROBABILITY", 1.1)
    monkeypatch.setattr(repeats, "chi_square_exceedance", lambda *_: 1e-4)
    rig = make_rig(noise__standstill_readings=16, noise__revisits=6)
    rig.operator.name = None
    await rig.run()
    (judged,) = happened(rig, events.ResultValidated)
    assert judged.verification is not None
    assert judged.verification.tests[-1].name == "scatter"


async def test_a_run_killed_among_confirming_records_goes_on_there(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))

    def cut(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.RecordTaken) and event.at == FIRST and event.orientation == 2:
            raise PowerCut

    with pytest.raises(PowerCut):
        await rig.run(cut)
    assert fold(read_journal(rig.folder.journal)).is_unverified
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    assert len(happened(rig, events.ConfirmationPlanned)) == 1
    assert orientations_taken(rig) == [1, 2, 3]


async def test_a_refused_confirming_pose_is_left_out(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))

    def refuse(event: events.Event, _: RunState) -> None:
        step = event.step if isinstance(event, events.StepBegun) else None
        if isinstance(step, Move) and (step.at, step.orientation) == (FIRST, 2):
            why = "would exceed joint 3's positive limit"
            rig.controller.failures["move"] = refused(Pose(*step.pose), why)

    ended = await rig.run(refuse)
    assert ended.exit_code == ExitCode.DONE
    (excluded,) = happened(rig, events.PoseExcluded)
    assert (excluded.at, excluded.orientation) == (FIRST, 2)
    assert orientations_taken(rig) == [1, 3]


def orientations_taken(rig: Any) -> list[int]:
    state = fold(read_journal(rig.folder.journal))
    return [sample.orientation for sample in state.set(FIRST).samples]
