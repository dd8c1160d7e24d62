"""Approval of a new geometry: by the gates, or by a person."""

import pytest

from hexacell.config.change import ConfigChange
from hexacell.errors import AnswerNeeded, ExitCode, LimitError
from procedures.engine.commands import UnattendedOperator
from procedures.steps import events
from tests.procedures.runs.listening import DOUBTFUL, FORBIDDEN, GOOD, happened, proposed


async def test_a_forbidding_gate_ends_the_run_before_anything_is_written(recording, replayed) -> None:
    rig = replayed(proposed(recording, GOOD, FORBIDDEN, DOUBTFUL))
    with pytest.raises(LimitError, match=r"refused: Beyond: l3 \(-13\.00 mm\)\.$") as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.OUT_OF_LIMITS
    assert rig.config == recording.config_before
    assert rig.operator.asked == []
    assert "reload" not in rig.controller.log


async def test_a_gate_that_requires_approval_ends_an_unattended_run(recording, replayed) -> None:
    rig = replayed(proposed(recording, GOOD, DOUBTFUL))
    object.__setattr__(rig.performer, "operator", UnattendedOperator())
    with pytest.raises(AnswerNeeded, match=r"approval: It is 20 mm\.") as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.ANSWER_NEEDED
    assert rig.config == recording.config_before
    assert ConfigChange.load(rig.folder.proposal).text_after.encode() == recording.config_after
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.ANSWER_NEEDED


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tolerances__l_mm": 1.0}, r"Beyond the drawing's tolerance: .*l"),
        ({"acceptance__largest_change_mm": 3.0}, r"largest change is \d\.\d+ mm, .*\(limit .* 3 mm\)"),
    ],
)
async def test_a_geometry_far_from_the_old_one_waits_for_a_person(recording, replayed, changes, words):
    rig = replayed(recording.until(events.SetClosed, count=4), **changes)
    object.__setattr__(rig.performer, "operator", UnattendedOperator())
    with pytest.raises(AnswerNeeded, match=words):
        await rig.run()
    assert rig.config == recording.config_before
    assert rig.folder.proposal.exists()


@pytest.mark.parametrize(("gates", "approval"), [([GOOD, DOUBTFUL], "automatic"), ([GOOD], "ask")])
async def test_a_person_may_approve(recording, replayed, gates, approval) -> None:
    rig = replayed(proposed(recording, *gates), acceptance__approval=approval)
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert happened(rig, events.Committed) == [events.Committed(approved_by="a tester")]
    assert rig.config == recording.config_after
    (asked,) = rig.operator.asked
    assert asked == (tuple(gates), ConfigChange.load(rig.folder.proposal).diff)


async def test_a_person_may_decline_and_approve_later(recording, replayed) -> None:
    rig = replayed(proposed(recording, GOOD, DOUBTFUL))
    rig.operator.name = None
    with pytest.raises(LimitError, match="declined; nothing was applied"):
        await rig.run()
    assert rig.config == recording.config_before
    rig.operator.name = "a tester"
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert len(rig.operator.asked) == 2
