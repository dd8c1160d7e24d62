"""Failures while measuring, a robot that is not where the run left it, and how the run goes on or ends."""

from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import numpy as np
import pytest

from hexacell.cell.recovery import Action
from hexacell.errors import AnswerNeeded, ExitCode, LimitError
from hexacell.kinematics.pose import Pose
from hexacell.noise.allowances import ReferenceChange
from procedures.engine.commands import UnattendedOperator
from procedures.run.keys import Phase, SetKey
from procedures.run.trips import Guard, GuardTripped
from procedures.steps import events
from procedures.steps.move import Move
from procedures.steps.revisit import Revisit
from tests.procedures.runs.listening import happened, on, run_until


async def test_a_slipped_gauge_stops_the_run_and_the_point_is_measured_again(recording, replayed) -> None:
    rig = replayed(recording.until(events.SetClosed, count=1), identification__orientations=4)
    real = rig.gauges[1].shown

    def slip() -> None:
        rig.gauges[1].shown = lambda: real() + 0.2

    with pytest.raises(LimitError, match=r"P2: back at the reference .*y \+0\.[12]"):
        await rig.run(on(events.RecordTaken, slip, count=2))
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.OUT_OF_LIMITS
    assert rig.controller.log[-1] == "stop"
    await run_until(rig, events.SetClosed)
    assert [str(event.at) for event in happened(rig, events.SetInvalidated)] == ["P2"]


@pytest.mark.parametrize(
    ("noise", "limits", "unexplained_mm", "is_kept"),
    [
        (object(), "measured", 0.03, False),
        (object(), "fixed", 0.03, True),
        (None, "measured", 0.03, True),
        (None, "measured", 0.06, False),
    ],
    ids=["measured noise", "walls", "stated noise", "stated noise, farther"],
)
async def test_gauges_that_may_have_been_moved_meanwhile_are_told_by_the_noise_if_it_is_measured(
    recording, noise, limits, unexplained_mm, is_kept
) -> None:
    reading = next(one for one in recording.history if isinstance(one, events.RecordTaken)).reading
    change = ReferenceChange(
        np.full(3, unexplained_mm), np.eye(3), np.eye(3), np.ones(3), np.zeros(6), 0.0, probability=0.01
    )
    settings = SimpleNamespace(reference_agreement=(0.05, 0.05), guards=SimpleNamespace(limits=limits))
    run: Any = SimpleNamespace(
        settings=settings,
        read=AsyncMock(return_value=reading),
        check_gauges=AsyncMock(),
        since_reference=lambda *_: change,
    )
    state: Any = SimpleNamespace(noise=noise)
    told = await Revisit(at=SetKey(phase=Phase.IDENTIFY, point=1)).perform(run, state)
    assert isinstance(told, events.ReferenceConfirmed if is_kept else events.SetInvalidated)


@pytest.mark.parametrize("slip_mm", [0.05, -0.3])
async def test_a_slipped_encoder_is_named_at_the_end_of_its_set(
    recording, replayed, slip_mm: float
) -> None:
    """Gauges would be blamed for the larger one, as they show what the encoders do not explain."""
    rig = replayed(recording.until(events.SetClosed, count=1), identification__orientations=4)
    real, slipped = rig.bench.encoders.shown, [0.0] * 6
    rig.bench.encoders.shown = lambda: [q + more for q, more in zip(real(), slipped, strict=True)]

    with pytest.raises(LimitError, match=r"encoder 3: P2: back at the reference q3 shows [+-]0\.\d+ mm"):
        await rig.run(on(events.RecordTaken, lambda: slipped.__setitem__(2, slip_mm), count=2))
    assert rig.controller.log[-1] == "stop"
    await run_until(rig, events.SetClosed)
    assert [str(event.at) for event in happened(rig, events.SetInvalidated)] == ["P2"]


async def test_an_unattended_run_with_gauges_placed_by_hand_ends(make_rig) -> None:
    rig = make_rig(operator=UnattendedOperator(), stations__placement="by-hand")
    with pytest.raises(AnswerNeeded):
        await rig.run()
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.ANSWER_NEEDED
    assert [entry.split()[0] for entry in rig.controller.log] == ["prepare", "move", "stop"]


FAR_AWAY = ((0.0, 0.0, 9000.0), (100.0, 100.0, 9000.0))
STATED_TOO_SMALL = {"noise__encoder": 2e-4, "noise__gauge_mm": 2e-4}


@pytest.mark.parametrize(
    ("noise", "verdict"), [({}, "Good: the records"), (STATED_TOO_SMALL, "Doubtful: ")]
)
async def test_where_no_held_out_pose_can_be_measured_the_verdict_is_told_first(
    recording, replayed, noise: dict[str, Any], verdict: str
) -> None:
    """A geometry that is wrong has no poses either: a person must not look for them at the points."""
    measured = recording.until(events.SetClosed, count=2)
    rig = replayed(measured, verification__points=FAR_AWAY, **noise)
    with pytest.raises(LimitError) as ended:
        await rig.run()
    assert ended.value.exit_code is ExitCode.OUT_OF_LIMITS
    told = str(ended.value)
    assert told.startswith(verdict)
    assert "With this geometry no held-out pose can be measured: the untilted platform" in told
    assert rig.folder.result.exists(), "the result can be looked at"


def returns(rig, since: int) -> list[Move]:
    """The moves of a resumed run up to where a reference is read again."""
    history = happened(rig, object)[since:]
    end = next(
        n for n, event in enumerate(history) if getattr(event, "kind", "") in {"confirmed", "voided"}
    )
    steps = [event.step for event in history[:end] if isinstance(event, events.StepBegun)]
    return [step for step in steps if isinstance(step, Move)]


@pytest.mark.sample("this point")
@pytest.mark.parametrize(
    ("records", "from_elsewhere"), [(13, True), (5, False)], ids=["other point", "this point"]
)
async def test_only_a_robot_far_from_the_gauges_returns_without_them(
    recording, replayed, records: int, from_elsewhere: bool
) -> None:
    """The simulated robot is at its home when a run is resumed, which is the first point."""
    history = recording.until(events.RecordTaken, count=records)
    rig = replayed(history)
    await run_until(rig, events.SetClosed)
    moves = returns(rig, len(history))
    assert moves
    assert moves[0].from_elsewhere is from_elsewhere


async def test_gauges_at_their_ends_on_the_way_back_are_no_verdict_on_a_written_geometry(
    recording, replayed
) -> None:
    """The ball is not at them, whatever they show meanwhile."""
    last = sum(isinstance(event, events.RecordTaken) for event in recording.history)
    history = recording.until(events.RecordTaken, count=last - 1)
    rig = replayed(history)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    assert returns(rig, len(history))[0].from_elsewhere
    assert not happened(rig, events.RolledBack)


def jogs(rig: Any) -> Any:
    """A listener: after the third record somebody moves the robot by two millimetres."""

    def jog() -> None:
        here = rig.machine.pose()
        rig.machine.move(Pose(here.x + 2.0, here.y, here.z, here.a, here.b, here.c))

    return on(events.RecordTaken, jog, 3)


def moves(rig: Any) -> int:
    return sum(entry.startswith("move") for entry in rig.controller.log)


async def test_nothing_moves_and_the_message_says_where_the_robot_is(make_rig) -> None:
    rig = make_rig()
    sent: list[int] = []
    count = on(events.RecordTaken, lambda: sent.append(moves(rig)), 3)
    with pytest.raises(GuardTripped, match=r"and not at .*, where it arrived: it was moved") as tripped:
        await rig.run(jogs(rig), count)
    assert tripped.value.trip.guard is Guard.POSITION
    assert sent == [moves(rig)]


async def test_a_person_retries_and_the_run_plans_from_where_the_robot_is(make_rig) -> None:
    rig = make_rig()
    rig.operator.decisions = [Action.RETRY]
    policy = rig.cell.settings.recovery.attended
    await run_until(rig, events.SetClosed, jogs(rig), policy=policy)
    assert len(happened(rig, events.Located)) > 1
    assert len(rig.operator.problems) == 1
