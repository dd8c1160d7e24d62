"""The next step, as a table of past events and what follows where a run does not go straight on."""

from types import SimpleNamespace
from typing import Any

import pytest

from hexacell.campaign import planner as module
from hexacell.campaign.decisions import MeasurePose
from hexacell.campaign.stopping_rules import REFUSALS
from hexacell.errors import LimitError
from hexacell.kinematics.pose import Pose
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import Verification
from procedures.calibration.calibration import Mode
from procedures.run.keys import Phase, SetKey
from procedures.run.state import fold
from procedures.steps import events
from procedures.steps.move import Move
from procedures.steps.roll_back import RollBack
from procedures.workflow import sets as path_planning
from procedures.workflow.points import IdentificationSteps
from tests.procedures.story import Story, an_identification, located, next_step

POINTS, ORIENTATIONS, HELD_OUT = 2, 9, 3
HELD_OUT_POSES = tuple(
    tuple((float(point), 0.0, 500.0, float(n), 0.0, 0.0) for n in range(HELD_OUT)) for point in (1, 2)
)
IDENTIFIED = events.Identified(result=an_identification(), held_out=HELD_OUT_POSES)
PROPOSED = events.Proposed(gates=(), written=an_identification().geometry)
COMMITTED = events.Committed(approved_by="a tester")
ENDED = events.Ended(exit_code=0, line="over")
PASS, WORSE, OUT, UNKNOWN = (
    events.ResultValidated(verdict=verdict, line="so it is")
    for verdict in (Verdict.PASS, Verdict.FAIL, Verdict.FAIL, Verdict.NOT_EVALUATED)
)
OFFERED = events.ResultValidated(
    verdict=Verdict.CONDITIONAL_FAIL,
    line="so it is",
    verification=Verification(verdict=Verdict.CONDITIONAL_FAIL, before_mm=3.0, after_mm=0.2),
)
LOCATED = located((100.0, -100.0, 500.0, 0.0, 0.0, 0.0))
WITHDRAWING = events.StepBegun(step=RollBack())
INTERRUPTED = events.Interrupted(reason="a power cut", exit_code=130)


def s(phase: Phase = Phase.IDENTIFY, point: int = 1) -> Story:
    """The story of one set."""
    return Story(SetKey(phase=phase, point=point))


def sets(phase: Phase, orientations: int) -> list[events.Event]:
    return [event for point in (1, 2) for event in s(phase, point).whole(orientations)]


MEASURED = sets(Phase.IDENTIFY, ORIENTATIONS)
FOUND = [*MEASURED, IDENTIFIED]
BEFORE = [*FOUND, *sets(Phase.BEFORE, HELD_OUT)]
WRITTEN = [*BEFORE, PROPOSED, COMMITTED]
AFTER = [*WRITTEN, *sets(Phase.AFTER, HELD_OUT)]
"""What has happened by the end of each stage."""


def refused_at_a_pose(told_of: Any) -> list[events.Event]:
    """The set of a story up to its second pose, at which the ball is outside the travel."""
    return [*told_of.whole(1)[:3], told_of.arrived(2), told_of.refused()]


def verified_after_a_refusal(told_of: Any) -> list[events.Event]:
    """The same, back at the reference, where the gauges show what they did."""
    return [*refused_at_a_pose(told_of), told_of.arrived(1), told_of.confirmed()]


def refused_twice(told_of: Any) -> list[events.Event]:
    """The same, and the ball is outside the travel at that pose again."""
    return [*verified_after_a_refusal(told_of), told_of.arrived(2), told_of.refused()]


LATER = s(Phase.AFTER)
MISSED = [*s().whole(2)[:-2], *[s().arrived(3), s().refused(3)] * (REFUSALS + 1)]
FOUND_AGAIN = [*s().whole(3)[:-2], INTERRUPTED, LOCATED]

Table = dict[str, tuple[list[events.Event], str | None]]
TABLE: Table = {
    "nothing": ([], "P1/o01/move"),
    "zeroed": (s().whole(1)[:3], "P1/o02/move"),
    "refused there": ([*s().whole(1)[:3], s().arrived(2), s().refused()], "P1/o02/move"),
    "refused too often": (MISSED, "P1/o01/move"),
    "back after too many refusals": ([*MISSED, s().arrived(1)], "P1/close"),
    "the reference refused": ([s().excluded(1)], "P2/o01/move"),
    "closed with few records": (s().whole(1), "P2/o01/move"),
    "interrupted at a pose": ([s().arrived(), INTERRUPTED], "locate"),
    "found after an interruption": ([s().arrived(), INTERRUPTED, LOCATED], "P1/o01/move"),
    "interrupted with records": (FOUND_AGAIN, "P1/o01/move"),
    "back at the reference to see": ([*FOUND_AGAIN, s().arrived()], "P1/revisit"),
    "seen to be as before": ([*FOUND_AGAIN, s().arrived(), s().confirmed()], "P1/o04/move"),
    "the last record undone": ([*s().whole(3)[:-2], s().undone(3)], "P1/o03/sample"),
    "an earlier record undone": ([*s().whole(4)[:-2], s().undone(3)], "P1/o03/move"),
    "a record of a closed set undone": ([*MEASURED, s().undone(3)], "P1/o01/move"),
    "a set voided": ([*s().whole(3)[:-2], s().voided()], "P1/o01/move"),
    "an earlier set voided": ([*MEASURED, s(Phase.IDENTIFY, 1).voided()], "P1/o01/move"),
    "taking it back was interrupted": ([*WRITTEN, WITHDRAWING, INTERRUPTED, LOCATED], "roll back"),
    "taken back without a verdict": ([*WRITTEN, WITHDRAWING, events.RolledBack()], "commit"),
    "refused on the way later": ([*WRITTEN, *LATER.whole(1)[:3], LATER.refused(on_the_way=True)], "locate"),
    "refused at a pose later": ([*WRITTEN, *refused_at_a_pose(LATER)], "after-V1/o01/move"),
    "back after a refusal": ([*WRITTEN, *refused_at_a_pose(LATER), LATER.arrived(1)], "after-V1/revisit"),
    "taken again later": ([*WRITTEN, *verified_after_a_refusal(LATER)], "after-V1/o02/move"),
    "refused twice later": ([*WRITTEN, *refused_twice(LATER)], "after-V1/o01/move"),
    "back after two refusals": ([*WRITTEN, *refused_twice(LATER), LATER.arrived(1)], "judge"),
    "refused on the way back": ([*WRITTEN, *refused_at_a_pose(LATER), LATER.refused(1), LOCATED], "judge"),
    "passed": ([*AFTER, PASS], None),
    "worse": ([*AFTER, WORSE], "roll back"),
    "out of limits": ([*AFTER, OUT], "roll back"),
    "no evidence": ([*AFTER, UNKNOWN], "roll back"),
    "rolled back": ([*AFTER, WORSE, events.RolledBack()], None),
    "kept by a person": ([*AFTER, OFFERED, events.ResultAccepted(by="a tester")], None),
    "better but not good enough": ([*AFTER, OFFERED], "accept"),
    "kept by nobody": ([*AFTER, OFFERED, events.ResultAccepted(by=None)], "roll back"),
    "rolling back interrupted": ([*AFTER, WORSE, INTERRUPTED], "roll back"),
    "over": ([ENDED], None),
}


@pytest.mark.parametrize("name", TABLE)
def test_the_next_step_of_a_calibration(name: str, calibration, monkeypatch) -> None:
    happened, key = TABLE[name]
    choices = Choices(monkeypatch)
    step = next_step(calibration, fold(happened))
    assert (step.key if step else None) == key
    chosen = {"P1/o02/move", "P1/o03/move", "P1/o04/move"}
    assert choices.made == (1 if key in chosen and "undone" not in name else 0)


CHECKS: Table = {
    "nothing": ([], "P1/o01/move"),
    "at the first point": ([s().arrived(), s().placed()], "P1/o01/sample"),
    "passed": ([*MEASURED, PASS], None),
    "out of limits": ([*MEASURED, OUT], None),
}


@pytest.mark.parametrize("name", CHECKS)
def test_the_next_step_of_a_check(name: str, make_rig) -> None:
    happened, key = CHECKS[name]
    step = next_step(make_rig(Mode.CHECK).calibration, fold(happened))
    assert (step.key if step else None) == key


class Choices:
    """Stands in for the choice of the next pose; counts, and shows what it was asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, refusal: LimitError | None = None) -> None:
        self.made = 0
        self._refusal = refusal
        monkeypatch.setattr(module.Plan, "_next_pose", self._choose)
        monkeypatch.setattr(path_planning, "next_return_move", lambda *_: 0)
        known = None, SimpleNamespace(reference=None)
        monkeypatch.setattr(IdentificationSteps, "_known", lambda *_: known)

    def _choose(self, situation: Any, point: int) -> MeasurePose:
        self.made += 1
        if self._refusal:
            raise self._refusal
        return MeasurePose(
            point=point,
            orientation=situation.records_at(point) + 1,
            pose=Pose(100.0, -100.0, 500.0, 3.0, 2.0, 1.0),
            joints=(0.0,) * 6,
            deviation=(0.0,) * 3,
            sigma=(0.1,) * 3,
            gain=1.0,
            forecast=None,
        )


def test_a_set_is_closed_at_the_pose_of_its_reference(calibration, monkeypatch) -> None:
    Choices(monkeypatch)
    pose = (99.0, -99.0, 501.0, 0.5, 0.0, 0.0)
    happened = [s().arrived(1, pose), s().placed(), s().sampled(1, pose=pose)]
    for orientation in range(2, ORIENTATIONS + 1):
        happened += [s().arrived(orientation), s().sampled(orientation)]
    step = next_step(calibration, fold(happened))
    assert isinstance(step, Move)
    assert step.pose == pose


def test_a_set_without_a_pose_worth_visiting_is_closed(calibration, monkeypatch) -> None:
    Choices(monkeypatch, LimitError("no orientation surely keeps the ball inside"))
    step = next_step(calibration, fold(s().whole(3)[:-2]))
    assert step.key == "P1/o01/move"


def test_held_out_poses_are_those_chosen_when_identified_before_and_after(calibration) -> None:
    for stage, phase in ((FOUND, Phase.BEFORE), (WRITTEN, Phase.AFTER)):
        happened = [*stage, LOCATED]
        for orientation in range(1, HELD_OUT + 1):
            step = next_step(calibration, fold(happened))
            assert step.pose == HELD_OUT_POSES[0][orientation - 1]
            happened += [s(phase).arrived(orientation), s(phase).placed()]
            happened += [s(phase).sampled(orientation)]


@pytest.mark.parametrize("phase", [Phase.IDENTIFY, Phase.BEFORE, Phase.AFTER])
def test_gauges_that_cannot_be_zeroed_end_the_run(calibration, phase: Phase) -> None:
    happened = {Phase.BEFORE: FOUND, Phase.AFTER: WRITTEN}.get(phase, [])
    refused = [*happened, s(phase).arrived(), s(phase).placed(), s(phase).refused(1)]
    with pytest.raises(LimitError, match=f"{phase.value}1: the gauges cannot be zeroed"):
        next_step(calibration, fold(refused))


def test_a_held_out_pose_outside_the_travel_ends_the_run_before_anything_is_written(calibration):
    refused = [*FOUND, *s(Phase.BEFORE).whole(1)[:3], s(Phase.BEFORE).refused()]
    with pytest.raises(LimitError, match="before-V1: the ball left the gauges' travel"):
        next_step(calibration, fold(refused))
