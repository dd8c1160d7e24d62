"""The next step, as a table of past events and the step that follows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hexacell.campaign import planner as module
from hexacell.campaign import pose_chooser
from hexacell.campaign.decisions import MeasurePose
from hexacell.campaign.stopping_rules import REFUSALS
from hexacell.decision import Verdict
from hexacell.errors import LimitError
from hexacell.kinematics.pose import Pose
from hexacell.motion.paths import find_route
from hexacell.reporting.verification import Verification
from procedures.calibration import path_planning
from procedures.calibration.identification_steps import IdentificationSteps
from procedures.calibration.workflow import Mode, expected_records
from procedures.run import events
from procedures.run.state import fold
from procedures.run.steps import Compute, Move, Phase, Place, Sample
from tests.procedures.identified import an_identification

POINTS, ORIENTATIONS, HELD_OUT = 2, 9, 3
HELD_OUT_POSES = tuple(
    tuple((float(point), 0.0, 500.0, float(n), 0.0, 0.0) for n in range(HELD_OUT)) for point in (1, 2)
)
IDENTIFIED = events.Identified(result=an_identification(), held_out=HELD_OUT_POSES)
PROPOSED = events.Proposed(gates=())
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
LOCATED = events.Located(pose=(100.0, -100.0, 500.0, 0.0, 0.0, 0.0))
WITHDRAWING = events.StepBegun(step=Compute(kind="roll back"))
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
        lambda s, t: [
            *t["committed"],
            *s(Phase.AFTER).whole(1)[:3],
            s(Phase.AFTER).arrived(2),
            s(Phase.AFTER).refused(),
        ],
        "after-V1/o01/move",
    ),
    "back at the reference afterwards": (
        lambda s, t: [
            *t["committed"],
            *s(Phase.AFTER).whole(1)[:3],
            s(Phase.AFTER).arrived(2),
            s(Phase.AFTER).refused(),
            s(Phase.AFTER).arrived(1),
        ],
        "judge",
    ),
    "refused again on the way back": (
        lambda s, t: [
            *t["committed"],
            *s(Phase.AFTER).whole(1)[:3],
            s(Phase.AFTER).arrived(2),
            s(Phase.AFTER).refused(),
            s(Phase.AFTER).refused(1),
            LOCATED,
        ],
        "judge",
    ),
    "reference refused afterwards": (
        lambda s, t: [*t["committed"], s(Phase.AFTER).arrived(), s(Phase.AFTER).refused(1)],
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
    step = rig.calibration.next_step(fold(happened(story, told)))
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
    step = make_rig(Mode.CHECK).calibration.next_step(fold(happened(story, told)))
    assert (step.key if step else None) == key


class Choices:
    """Stands in for the choice of the next pose; counts, and shows what it was asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, refusal: LimitError | None = None) -> None:
        self.made = 0
        self._refusal = refusal
        monkeypatch.setattr(module.Plan, "_next_pose", self._choose)
        monkeypatch.setattr(path_planning, "next_return_move", lambda *_: 0)
        known = None, SimpleNamespace(reference=None)
        monkeypatch.setattr(IdentificationSteps, "_estimated", lambda *_: known)

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
    step = rig.calibration.next_step(fold([]))
    assert step.pose == (*rig.cell.settings.identification.points[0], 0.0, 0.0, 0.0)
    assert step.expected is None


def test_placing_and_sampling_happen_at_the_pose_commanded(make_rig, story) -> None:
    pose = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    calibration = make_rig().calibration
    place = calibration.next_step(fold([story().arrived(1, pose)]))
    assert isinstance(place, Place)
    assert place.pose == pose
    sample = calibration.next_step(fold([story().arrived(1, pose), story().placed()]))
    assert isinstance(sample, Sample)
    assert sample.pose == pose


def test_a_set_is_closed_at_the_pose_of_its_reference(make_rig, story, monkeypatch) -> None:
    Choices(monkeypatch)
    pose = (99.0, -99.0, 501.0, 0.5, 0.0, 0.0)
    happened = [story().arrived(1, pose), story().placed(), story().sampled(1, pose=pose)]
    for orientation in range(2, ORIENTATIONS + 1):
        happened += [story().arrived(orientation), story().sampled(orientation)]
    step = make_rig().calibration.next_step(fold(happened))
    assert isinstance(step, Move)
    assert step.pose == pose


def test_a_set_without_a_pose_worth_visiting_is_closed(make_rig, story, monkeypatch) -> None:
    Choices(monkeypatch, LimitError("no orientation surely keeps the ball inside"))
    step = make_rig().calibration.next_step(fold(story().whole(3)[:-2]))
    assert step.key == "P1/o01/move"


def test_held_out_poses_are_those_chosen_when_identified_before_and_after(make_rig, story, told) -> None:
    calibration = make_rig().calibration
    for stage, phase in (("identified", Phase.BEFORE), ("committed", Phase.AFTER)):
        happened = [*told[stage], LOCATED]
        for orientation in range(1, HELD_OUT + 1):
            step = calibration.next_step(fold(happened))
            assert step.pose == HELD_OUT_POSES[0][orientation - 1]
            happened += [story(phase).arrived(orientation), story(phase).placed()]
            happened += [story(phase).sampled(orientation)]


@pytest.mark.parametrize("phase", [Phase.IDENTIFY, Phase.BEFORE])
def test_gauges_that_cannot_be_zeroed_end_the_run(make_rig, story, told, phase: Phase) -> None:
    happened = [] if phase is Phase.IDENTIFY else told["identified"]
    refused = [*happened, story(phase).arrived(), story(phase).placed(), story(phase).refused(1)]
    with pytest.raises(LimitError, match=f"{phase.value}1: the gauges cannot be zeroed"):
        make_rig().calibration.next_step(fold(refused))


def test_a_held_out_pose_outside_the_travel_ends_the_run_before_anything_is_written(
    make_rig, story, told
) -> None:
    refused = [*told["identified"], *story(Phase.BEFORE).whole(1)[:3], story(Phase.BEFORE).refused()]
    with pytest.raises(LimitError, match="before-V1: the ball left the gauges' travel"):
        make_rig().calibration.next_step(fold(refused))


def test_a_chosen_pose_keeps_the_ball_inside_the_travel_and_gains_information(recording) -> None:
    moves = [event.step for event in recording.history if isinstance(event, events.StepBegun)]
    chosen = [step for step in moves if isinstance(step, Move) and step.expected]
    assert len(chosen) == POINTS * (ORIENTATIONS - 1)
    for step in chosen:
        assert step.expected is not None
        reach = np.abs(step.expected.deviation_mm) + 3.0 * np.array(step.expected.sigma_mm)
        assert reach.max() <= 0.9 * 5.0
        assert step.expected.gain > 0.0


def test_measured_deviations_agree_with_the_expected_ones(recording) -> None:
    """Expected and measured deviations differ by a few sigma at most, over the whole run."""
    expected = {
        (event.step.at, event.step.orientation): event.step.expected
        for event in recording.history
        if isinstance(event, events.StepBegun) and isinstance(event.step, Move) and event.step.expected
    }
    wrong_by = [
        np.abs(np.subtract(event.deviation_mm, expected[event.at, event.orientation].deviation_mm))
        / expected[event.at, event.orientation].sigma_mm
        for event in recording.history
        if isinstance(event, events.RecordTaken) and (event.at, event.orientation) in expected
    ]
    assert np.max(wrong_by) < 5.0
    assert np.median(wrong_by) < 1.5


def test_the_next_step_depends_on_the_state_only(recording, make_rig) -> None:
    """A resumed run chooses the same steps as an uninterrupted one."""
    history = recording.history
    places = [n for n, event in enumerate(history) if isinstance(event, events.StepBegun)]
    calibration = make_rig().calibration
    for place in places[3::9]:
        event = history[place]
        assert isinstance(event, events.StepBegun)
        assert calibration.next_step(fold(history[:place])) == event.step


def test_after_a_refusal_another_pose_is_chosen(recording, make_rig) -> None:
    sampled = recording.until(events.RecordTaken, count=6)
    calibration = make_rig().calibration
    first = calibration.next_step(fold(sampled))
    assert isinstance(first, Move)
    arrived = events.Arrived(at=first.at, orientation=first.orientation, pose=first.pose)
    refused = events.RecordRejected(at=first.at, orientation=first.orientation, reason="outside")
    second = calibration.next_step(fold([*sampled, arrived, refused]))
    assert isinstance(second, Move)
    assert second.key == first.key
    assert second.pose != first.pose


def test_the_path_after_a_refusal_begins_at_the_present_pose(recording, make_rig, monkeypatch) -> None:
    """Not at the last record: the refused pose is where the straight lines start that are checked."""
    starts: list[Any] = []

    def spy(belief: Any, start: Any, *others: Any) -> Any:
        starts.append(start.pose(0).as_tuple())
        return find_route(belief, start, *others)

    monkeypatch.setattr(pose_chooser, "find_route", spy)
    sampled = recording.until(events.RecordTaken, count=4)
    refused_at = (101.0, -99.0, 502.0, 4.0, -3.0, 2.0)
    key = sampled[-1].at
    happened = [
        *sampled,
        events.Arrived(at=key, orientation=5, pose=refused_at),
        events.RecordRejected(at=key, orientation=5, reason="outside"),
    ]
    make_rig().calibration.next_step(fold(happened))
    assert starts[0] == pytest.approx(refused_at)


def _passes(step: Any, following: Any) -> bool:
    """Whether a step is a move to a pose on the way back, where nothing is measured."""
    return isinstance(step, Move) and isinstance(following, Move)


@pytest.mark.parametrize(("mode", "seen"), [(Mode.OPTIMISE, 40), (Mode.CHECK, 42)])
def test_the_number_of_expected_records(make_rig, mode: Mode, seen: int) -> None:
    assert expected_records(make_rig(mode).cell.settings, mode) == seen


def test_a_run_takes_the_expected_number_of_records(recording, make_rig) -> None:
    came = sum(isinstance(event, events.RecordTaken | events.SetClosed) for event in recording.history)
    assert came == expected_records(make_rig().cell.settings, Mode.OPTIMISE)


def test_the_steps_of_a_whole_run_in_their_order(recording) -> None:
    begun = [event.step for event in recording.history if isinstance(event, events.StepBegun)]
    keys = [
        step.key for step, following in pairwise([*begun, None]) if step and not _passes(step, following)
    ]

    def of_set(name: str, orientations: int) -> list[str]:
        rest = [
            f"{name}/o{n:02d}/{what}" for n in range(2, orientations + 1) for what in ("move", "sample")
        ]
        begin = [f"{name}/o01/move", f"{name}/place", f"{name}/o01/sample"]
        return [*begin, *rest, f"{name}/o01/move", f"{name}/close"]

    assert keys == [
        "locate",
        *of_set("P1", ORIENTATIONS),
        *of_set("P2", ORIENTATIONS),
        "identify",
        *of_set("before-V1", HELD_OUT),
        *of_set("before-V2", HELD_OUT),
        "propose",
        "commit",
        "locate",
        *of_set("after-V1", 2 * HELD_OUT - 1),
        *of_set("after-V2", 2 * HELD_OUT - 1),
        "judge",
    ]
