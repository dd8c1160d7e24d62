"""Failures while measuring, and how the run continues or ends."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.errors import GaugeAtEnd
from hexacell.errors import AnswerNeeded, ExitCode, HexacellError, LimitError
from hexacell.measurements.csv_file import read_measurements
from procedures.engine.commands import UnattendedOperator
from procedures.steps import events
from tests.procedures.runs.listening import at_step, happened, on, run_until


async def test_after_a_rejected_record_another_pose_is_measured(make_rig) -> None:
    rig = make_rig()
    at_ends = [GaugeAtEnd("is at an end of its travel", subject=f"gauge {name}") for name in "xy"]

    def once() -> None:
        for gauge in rig.gauges[: len(at_ends)]:
            gauge.failures.append(at_ends.pop(0))

    await run_until(rig, events.SetClosed, at_step("P1/o03/sample", once))
    (refused,) = happened(rig, events.RecordRejected)
    assert (str(refused.at), refused.orientation) == ("P1", 3)
    begun = [event.step for event in happened(rig, events.StepBegun)]
    first, second = (step.pose for step in begun if step.key == "P1/o03/move")
    assert first != second
    taken = next(event for event in happened(rig, events.RecordTaken) if event.orientation == 3)
    assert taken.pose == second


async def test_a_slipped_gauge_stops_the_run_and_the_point_is_measured_again(recording, replayed) -> None:
    rig = replayed(recording.until(events.SetClosed, count=1))
    real = rig.gauges[1].shown

    def slip() -> None:
        rig.gauges[1].shown = lambda: real() + 0.2

    with pytest.raises(LimitError, match=r"P2: back at the reference .*y \+0\.[12]"):
        await rig.run(on(events.RecordTaken, slip, count=5))
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.OUT_OF_LIMITS
    assert rig.controller.log[-1] == "stop"
    await run_until(rig, events.SetClosed)
    assert [str(event.at) for event in happened(rig, events.SetInvalidated)] == ["P2"]


async def test_gauges_placed_by_hand_are_requested_at_every_point(recording, replayed) -> None:
    rig = replayed(recording.until(events.SetClosed, count=2), stations__placement="by-hand")
    await rig.run()
    assert rig.operator.placed == [1, 2, 1, 2]


async def test_an_unattended_run_with_gauges_placed_by_hand_ends(make_rig) -> None:
    rig = make_rig(operator=UnattendedOperator(), stations__placement="by-hand")
    with pytest.raises(AnswerNeeded):
        await rig.run()
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.ANSWER_NEEDED
    assert [entry.split()[0] for entry in rig.controller.log] == ["prepare", "move", "stop"]


async def test_too_few_records_to_identify_are_reported_and_nothing_is_written(make_rig) -> None:
    rig = make_rig(identification__orientations=3)
    before = rig.config
    with pytest.raises(HexacellError, match="12 equations for 35 parameters") as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.OUT_OF_LIMITS
    assert rig.config == before
    assert len(read_measurements(rig.folder.measurements)) == 6


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
