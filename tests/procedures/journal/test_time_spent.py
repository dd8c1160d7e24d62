"""What the time of a run was spent on, by the lines of its journal."""

from datetime import UTC, datetime

import pytest

from hexacell.campaign.time_model import Overheads, TimeKind, speed_limits
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.measuring import TimingSettings
from hexacell.cell.recovery import Action, FailureKind
from hexacell.kinematics.pose import Pose
from hexacell.motion.durations import line_duration
from hexacell.robot.model import robot_of
from procedures.journal.journal import Entry
from procedures.journal.time_spent import overheads_of, time_spent
from procedures.run.keys import Phase, SetKey, SixNumbers
from procedures.steps import events
from tests.procedures.story import Story
from tests.small_cell import changed

AT = SetKey(phase=Phase.IDENTIFY, point=1)
POSE = (0.0, 0.0, 550.0, 0.0, 0.0, 0.0)
MOVE = events.StepBegun(step=events.Move(at=AT, orientation=2, pose=POSE))
SAMPLE = events.StepBegun(step=events.Sample(at=AT, orientation=2, pose=POSE))
PLACE = events.StepBegun(step=events.Place(at=AT, pose=POSE))
ARRIVED = events.Arrived(at=AT, orientation=2, pose=POSE)
REJECTED = events.RecordRejected(at=AT, orientation=2, reason="outside")
ASKED = events.Failed(
    step=None, failure=FailureKind.GAUGE_SILENT, attempt=1, reason="silent", action=Action.ASK
)


def spent(*told: tuple[float, events.Event], **timing: float) -> dict[TimeKind, object]:
    """Of events at some seconds; only what is not 0."""
    now = datetime.now(UTC)
    entries = [Entry(number, now, at_s, event) for number, (at_s, event) in enumerate(told, start=1)]
    every = time_spent(entries, TimingSettings(window_s=0.6, **timing))
    assert set(every) == set(TimeKind)
    return {kind: pytest.approx(seconds) for kind, seconds in every.items() if seconds}


def test_each_step_is_of_its_kind_and_what_is_between_is_deciding() -> None:
    found = spent(
        (0.0, MOVE), (5.0, ARRIVED), (5.2, SAMPLE), (6.5, REJECTED), (6.6, PLACE), (66.6, ARRIVED)
    )
    assert found == {
        TimeKind.MOVING: 5.0,
        TimeKind.DECIDING: 0.3,
        TimeKind.READING: 0.6,
        TimeKind.SETTLING: 0.7,
        TimeKind.PLACING: 60.0,
    }


def test_a_person_who_is_waited_for_is_asked() -> None:
    found = spent((0.0, events.Paused()), (30.0, events.Resumed()), (30.5, ASKED), (90.5, MOVE))
    assert found == {TimeKind.ASKING: 90.0, TimeKind.DECIDING: 0.5}


def test_what_is_between_two_programs_is_not_of_the_run() -> None:
    ended = events.Interrupted(reason="a power cut", exit_code=130)
    assert spent((0.0, MOVE), (2.0, ended), (5000.0, MOVE), (1.0, ARRIVED)) == {TimeKind.MOVING: 2.0}


def test_a_fast_clock_counts_for_the_machine_alone() -> None:
    found = spent((0.0, MOVE), (0.1, ARRIVED), (0.2, SAMPLE), (0.26, REJECTED), clock_factor=10.0)
    assert found == {TimeKind.MOVING: 1.0, TimeKind.DECIDING: 0.1, TimeKind.READING: 0.6}


def move_to(orientation: int, pose: SixNumbers) -> events.Event:
    return events.StepBegun(step=events.Move(at=AT, orientation=orientation, pose=pose))


def a_run(moves: int, clock_factor: float = 1.0) -> Overheads | None:
    """Of moves that take 0.7 s longer than their ways, one 5.7 s, and of readings 0.45 s than a window."""
    cell = load_cell(bundled_config("simulated-hexaglide"))
    settings = changed(cell.settings, {"timing.clock_factor": clock_factor, "timing.window_s": 0.4})
    robot, speeds = robot_of(cell), speed_limits(settings.speed, at_gauges=True)
    poses = POSE, (0.0, 0.0, 550.0, 4.0, 0.0, 0.0)
    start, end = (Pose(*pose) for pose in poses)
    line_s = line_duration(robot.mechanism, robot.controller, robot.branch, start, end, speeds)
    story, at_s = Story(AT), 0.0
    entries: list[Entry] = []
    for number in range(moves):
        pose, orientation = poses[number % 2], 2 + number
        for event, seconds in (
            (move_to(orientation, pose), line_s + (5.7 if number == 5 else 0.7)),
            (story.arrived(orientation, pose), 0.01),
            (SAMPLE, 0.85),
            (story.sampled(orientation, pose=pose), 0.01),
        ):
            entries.append(Entry(len(entries) + 1, datetime.now(UTC), at_s, event))
            at_s += seconds
    return overheads_of(entries, settings, robot)


def test_moves_and_readings_tell_what_the_next_will_take() -> None:
    found = a_run(12)
    assert found is not None
    assert found.move_s == pytest.approx(0.7)
    assert found.reading_s == pytest.approx(0.45)
    assert found.place_s is None, "nobody placed the gauges"
    assert a_run(6) is None, "too few"
    assert a_run(12, clock_factor=10.0) is None, "mostly the computer's own time"
