"""The next step, as a table of past events and the step that follows."""

from __future__ import annotations

from collections.abc import Callable
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
from procedures.run.keys import Phase
from procedures.run.state import fold
from procedures.steps import events
from procedures.steps.move import Move
from procedures.steps.place import Place
from procedures.steps.roll_back import RollBack
from procedures.steps.sample import Sample
from procedures.workflow import sets as path_planning
from procedures.workflow.points import IdentificationSteps
from tests.procedures.identified import an_identification
from tests.procedures.story import located, next_step

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
    for verdict in (
        Verdict.PASS,
        Verdict.FAIL,
        Verdict.FAIL,
        Verdict.NOT_EVALUATED,
    )
)
OFFERED = events.ResultValidated(
    verdict=Verdict.CONDITIONAL_FAIL,
    line="so it is",
    verification=Verification(verdict=Verdict.CONDITIONAL_FAIL, before_mm=3.0, after_mm=0.2),
)
LOCATED = located((100.0, -100.0, 500.0, 0.0, 0.0, 0.0))
WITHDRAWING = events.StepBegun(step=RollBack())
INTERRUPTED = events.Interrupted(reason="a power cut", exit_code=130)


@pytest.fixture
def told(story) -> dict[str, list[events.Event]]:
    """What has happened by the end of each stage."""

    def sets(phase: Phase, orientations: int) -> list[events.Event]:
        return [event for point in (1, 2) for event in story(phase, point).whole(orientations)]

    stages: dict[str, list[events.Event]] = {"measured": sets(Phase.IDENTIFY, ORIENTATIONS)}
    stages["identified"] = [*stages["measured"], IDENTIFIED]
    stages["before"] = [*stages["identified"], *sets(Phase.BEFORE, HELD_OUT)]
    stages["committed"] = [*stages["before"], PROPOSED, COMMITTED]
    stages["after"] = [*stages["committed"], *sets(Phase.AFTER, HELD_OUT)]
    return stages


def refused_at_a_pose(told_of: Any) -> list[events.Event]:
    """The set of a story up to its second pose, at which the ball is outside the travel."""
    return [*told_of.whole(1)[:3], told_of.arrived(2), told_of.refused()]


def verified_after_a_refusal(told_of: Any) -> list[events.Event]:
    """The same, back at the reference, where the gauges show what they did."""
    return [*refused_at_a_pose(told_of), told_of.arrived(1), told_of.confirmed()]


def refused_twice(told_of: Any) -> list[events.Event]:
    """The same, and the ball is outside the travel at that pose again."""
    return [*verified_after_a_refusal(told_of), told_of.arrived(2), told_of.refused()]


Table = dict[str, tuple[Callable[[Any, Any], list[events.Event]], str | None]]
TABLE: Table = {
    "nothing": (lambda s, t: [], "P1/o01/move"),
    "at the first point": (lambda s, t: [s().arrived()], "P1/place"),
    "gauges placed": (lambda s, t: [s().arrived(), s().placed()], "P1/o01/sample"),
    "zeroed": (lambda s, t: s().whole(1)[:3], "P1/o02/move"),
    "at an orientation": (lambda s, t: [*s().whole(1)[:3], s().arrived(2)], "P1/o02/sample"),
    "sampled there": (lambda s, t: s().whole(2)[:-2], "P1/o03/move"),
    "refused there": (lambda s, t: [*s().whole(1)[:3], s().arrived(2), s().refused()], "P1/o02/move"),
    "refused too often": (
        lambda s, t: [*s().whole(2)[:-2], *[s().arrived(3), s().refused(3)] * (REFUSALS + 1)],
        "P1/o01/move",
    ),
    "all sampled": (lambda s, t: s().whole(ORIENTATIONS)[:-2], "P1/o01/move"),
    "back at the reference": (lambda s, t: s().whole(ORIENTATIONS)[:-1], "P1/close"),
    "back after too many refusals": (
        lambda s, t: [
            *s().whole(2)[:-2],
            *[s().arrived(3), s().refused(3)] * (REFUSALS + 1),
            s().arrived(1),
        ],
        "P1/close",
    ),
    "first point closed": (lambda s, t: s().whole(ORIENTATIONS), "P2/o01/move"),
    "closed with few records": (lambda s, t: s().whole(1), "P2/o01/move"),
    "interrupted at a pose": (lambda s, t: [s().arrived(), INTERRUPTED], "locate"),
    "found after an interruption": (lambda s, t: [s().arrived(), INTERRUPTED, LOCATED], "P1/o01/move"),
    "interrupted with records": (lambda s, t: [*s().whole(3)[:-2], INTERRUPTED, LOCATED], "P1/o01/move"),
    "back at the reference to see": (
        lambda s, t: [*s().whole(3)[:-2], INTERRUPTED, LOCATED, s().arrived()],
        "P1/revisit",
    ),
    "seen to be as before": (
        lambda s, t: [*s().whole(3)[:-2], INTERRUPTED, LOCATED, s().arrived(), s().confirmed()],
        "P1/o04/move",
    ),
    "the last record undone": (lambda s, t: [*s().whole(3)[:-2], s().undone(3)], "P1/o03/sample"),
    "an earlier record undone": (lambda s, t: [*s().whole(4)[:-2], s().undone(3)], "P1/o03/move"),
    "a record of a closed set undone": (lambda s, t: [*t["measured"], s().undone(3)], "P1/o01/move"),
    "a set voided": (lambda s, t: [*s().whole(3)[:-2], s().voided()], "P1/o01/move"),
    "an earlier set voided": (
        lambda s, t: [*t["measured"], s(Phase.IDENTIFY, 1).voided()],
        "P1/o01/move",
    ),
    "all points measured": (lambda s, t: t["measured"], "identify"),
    "identified": (lambda s, t: t["identified"], "before-V1/o01/move"),
    "at a held-out point": (
        lambda s, t: [*t["identified"], s(Phase.BEFORE).arrived()],
        "before-V1/place",
    ),
    "zeroed at a held-out point": (
        lambda s, t: [*t["identified"], *s(Phase.BEFORE).whole(1)[:3]],
        "before-V1/o02/move",
    ),
    "first held-out point closed": (
        lambda s, t: [*t["identified"], *s(Phase.BEFORE).whole(HELD_OUT)],
        "before-V2/o01/move",
    ),
    "held-out points measured": (lambda s, t: t["before"], "propose"),
    "proposed": (lambda s, t: [*t["before"], PROPOSED], "commit"),
    "committed": (lambda s, t: t["committed"], "locate"),
    "found after committing": (lambda s, t: [*t["committed"], LOCATED], "after-V1/o01/move"),
    "taking it back was interrupted": (
        lambda s, t: [*t["committed"], WITHDRAWING, INTERRUPTED, LOCATED],
        "roll back",
    ),
    "taken back without a verdict": (
        lambda s, t: [*t["committed"], WITHDRAWING, events.RolledBack()],
        "commit",
    ),
    "refused on the way afterwards": (
        lambda s, t: [*t["committed"], *s(Phase.AFTER).whole(1)[:3], s(Phase.AFTER).refused()],
        "locate",
    ),
    "refused at a pose afterwards": (
        lambda s, t: [*t["committed"], *refused_at_a_pose(s(Phase.AFTER))],
        "after-V1/o01/move",
    ),
    "back at the reference afterwards": (
        lambda s, t: [*t["committed"], *refused_at_a_pose(s(Phase.AFTER)), s(Phase.AFTER).arrived(1)],
        "after-V1/revisit",
    ),
    "taken again afterwards": (
        lambda s, t: [*t["committed"], *verified_after_a_refusal(s(Phase.AFTER))],
        "after-V1/o02/move",
    ),
    "refused twice afterwards": (
        lambda s, t: [*t["committed"], *refused_twice(s(Phase.AFTER))],
        "after-V1/o01/move",
    ),
    "back at the reference after two refusals": (
        lambda s, t: [*t["committed"], *refused_twice(s(Phase.AFTER)), s(Phase.AFTER).arrived(1)],
        "judge",
    ),
    "refused again on the way back": (
        lambda s, t: [
            *t["committed"],
            *refused_at_a_pose(s(Phase.AFTER)),
            s(Phase.AFTER).refused(1),
            LOCATED,
        ],
        "judge",
    ),
    "verified": (lambda s, t: t["after"], "judge"),
    "passed": (lambda s, t: [*t["after"], PASS], None),
    "worse": (lambda s, t: [*t["after"], WORSE], "roll back"),
    "out of limits": (lambda s, t: [*t["after"], OUT], "roll back"),
    "no evidence": (lambda s, t: [*t["after"], UNKNOWN], "roll back"),
    "rolled back": (lambda s, t: [*t["after"], WORSE, events.RolledBack()], None),
    "kept by a person": (
        lambda s, t: [*t["after"], OFFERED, events.ResultAccepted(by="a tester")],
        None,
    ),
    "better but not good enough": (lambda s, t: [*t["after"], OFFERED], "accept"),
    "kept by nobody": (lambda s, t: [*t["after"], OFFERED, events.ResultAccepted(by=None)], "roll back"),
    "rolling back interrupted": (lambda s, t: [*t["after"], WORSE, INTERRUPTED], "roll back"),
    "over": (lambda s, t: [ENDED], None),
}


@pytest.mark.parametrize("name", TABLE)
def test_the_next_step_of_a_calibration(name: str, make_rig, story, told, monkeypatch) -> None:
    happened, key = TABLE[name]
    rig = make_rig()
    choices = Choices(monkeypatch)
    step = next_step(rig.calibration, fold(happened(story, told)))
    assert (step.key if step else None) == key
    chosen = {"P1/o02/move", "P1/o03/move", "P1/o04/move"}
    assert choices.made == (1 if key in chosen and "undone" not in name else 0)


CHECKS: Table = {
    "nothing": (lambda s, t: [], "P1/o01/move"),
    "at the first point": (lambda s, t: [s().arrived(), s().placed()], "P1/o01/sample"),
    "passed": (lambda s, t: [*t["measured"], PASS], None),
    "out of limits": (lambda s, t: [*t["measured"], OUT], None),
}


@pytest.mark.parametrize("name", CHECKS)
def test_the_next_step_of_a_check(name: str, make_rig, story, told) -> None:
    happened, key = CHECKS[name]
    step = next_step(make_rig(Mode.CHECK).calibration, fold(happened(story, told)))
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


def test_references_are_the_cells_points_untilted(make_rig) -> None:
    rig = make_rig()
    step = next_step(rig.calibration, fold([]))
    assert step.pose == (*rig.cell.settings.identification.points[0], 0.0, 0.0, 0.0)
    assert step.expected is None


def test_placing_and_sampling_happen_at_the_pose_commanded(make_rig, story) -> None:
    pose = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    calibration = make_rig().calibration
    place = next_step(calibration, fold([story().arrived(1, pose)]))
    assert isinstance(place, Place)
    assert place.pose == pose
    sample = next_step(calibration, fold([story().arrived(1, pose), story().placed()]))
    assert isinstance(sample, Sample)
    assert sample.pose == pose


def test_a_set_is_closed_at_the_pose_of_its_reference(make_rig, story, monkeypatch) -> None:
    Choices(monkeypatch)
    pose = (99.0, -99.0, 501.0, 0.5, 0.0, 0.0)
    happened = [story().arrived(1, pose), story().placed(), story().sampled(1, pose=pose)]
    for orientation in range(2, ORIENTATIONS + 1):
        happened += [story().arrived(orientation), story().sampled(orientation)]
    step = next_step(make_rig().calibration, fold(happened))
    assert isinstance(step, Move)
    assert step.pose == pose


def test_a_set_without_a_pose_worth_visiting_is_closed(make_rig, story, monkeypatch) -> None:
    Choices(monkeypatch, LimitError("no orientation surely keeps the ball inside"))
    step = next_step(make_rig().calibration, fold(story().whole(3)[:-2]))
    assert step.key == "P1/o01/move"


def test_held_out_poses_are_those_chosen_when_identified_before_and_after(make_rig, story, told) -> None:
    calibration = make_rig().calibration
    for stage, phase in (("identified", Phase.BEFORE), ("committed", Phase.AFTER)):
        happened = [*told[stage], LOCATED]
        for orientation in range(1, HELD_OUT + 1):
            step = next_step(calibration, fold(happened))
            assert step.pose == HELD_OUT_POSES[0][orientation - 1]
            happened += [story(phase).arrived(orientation), story(phase).placed()]
            happened += [story(phase).sampled(orientation)]


@pytest.mark.parametrize("phase", [Phase.IDENTIFY, Phase.BEFORE, Phase.AFTER])
def test_gauges_that_cannot_be_zeroed_end_the_run(make_rig, story, told, phase: Phase) -> None:
    before = {Phase.IDENTIFY: None, Phase.BEFORE: "identified", Phase.AFTER: "committed"}[phase]
    happened = [] if before is None else told[before]
    refused = [*happened, story(phase).arrived(), story(phase).placed(), story(phase).refused(1)]
    with pytest.raises(LimitError, match=f"{phase.value}1: the gauges cannot be zeroed"):
        next_step(make_rig().calibration, fold(refused))


def test_a_held_out_pose_outside_the_travel_ends_the_run_before_anything_is_written(
    make_rig, story, told
) -> None:
    refused = [*told["identified"], *story(Phase.BEFORE).whole(1)[:3], story(Phase.BEFORE).refused()]
    with pytest.raises(LimitError, match="before-V1: the ball left the gauges' travel"):
        next_step(make_rig().calibration, fold(refused))
