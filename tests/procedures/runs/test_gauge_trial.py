"""Gauges that are mounted wrongly or off their middle are named before anything is measured with them."""

import re
from collections.abc import Callable
from functools import partial
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from drivers.errors import GaugeSilent
from hexacell.cell.recovery import Action, FailureKind
from hexacell.errors import ExitCode, HexacellError, LimitError
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from procedures.steps.move import Move
from procedures.steps.place import MountingError
from tests.procedures.runs.gauge_mistakes import MISTAKES, corrected, make_mistake
from tests.procedures.runs.listening import at_step, happened, on, run_until, steps_of

P1 = SetKey(phase=Phase.IDENTIFY, point=1)


@pytest.mark.sample("x and y exchanged", "? reversed", "z in inches", "x dead")
@pytest.mark.parametrize("mistake", MISTAKES)
async def test_a_mistake_is_named_at_the_first_station(make_rig, mistake: str) -> None:
    rig = make_rig(stations__trial_mm=1.0)
    make_mistake(rig, mistake)
    with pytest.raises(HexacellError, match=MISTAKES[mistake]) as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert {event.at for event in happened(rig, events.RecordTaken)} == {P1}
    assert len(happened(rig, events.RecordTaken)) == 1, "only the zero was recorded"
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.HARDWARE


@pytest.mark.parametrize("placement", ["by-hand", "fixed"])
async def test_every_station_is_tried_once_and_fixed_gauges_at_the_first(recording, replayed, placement):
    stations = {"stations__trial_mm": 1.0, "stations__placement": placement}
    rig = replayed(recording.until(events.Identified), **stations)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    tried = [str(event.at) for event in happened(rig, events.GaugesTried)]
    every = ["before-V1", "before-V2", "after-V1", "after-V2"]
    assert tried == (every if placement == "by-hand" else every[:1])
    assert len(happened(rig, events.GaugesProbed)) == 3 * len(tried)
    first = happened(rig, events.GaugesTried)[0].at
    trial = [f"{first}/o01/sample", *[f"{first}/o00/move", f"{first}/probe"] * 3]
    begun = [step.key for step in steps_of(rig)]
    assert begun[begun.index(trial[0]) :][:9] == [*trial, f"{first}/o01/move", f"{first}/try"]
    lengths = [
        np.abs(np.subtract(step.pose[:3], (-100.0, -50.0, 450.0))).max()
        for step in steps_of(rig)
        if isinstance(step, Move) and step.at == first and step.orientation == 0
    ]
    assert lengths[:3] == pytest.approx([1.0] * 3)


async def test_a_gauge_that_was_connected_again_is_tried_again(make_rig) -> None:
    rig = make_rig(stations__trial_mm=1.0)
    rig.right_gauges = {}
    silences = [GaugeSilent("does not answer", subject="gauge z")] * 2

    def turned_round() -> None:
        if silences:
            rig.gauges[2].failures.append(silences.pop())
        if not silences and not rig.right_gauges:
            make_mistake(rig, "z reversed")

    policy = rig.cell.settings.recovery.unattended
    with pytest.raises(HexacellError, match="gauge z: counts the wrong way"):
        await rig.run(at_step("P1/o03/sample", turned_round), policy=policy)
    assert [str(event.at) for event in happened(rig, events.GaugesTried)] == ["P1"]
    assert happened(rig, events.SetInvalidated), "its zero was void"


async def test_after_an_interruption_the_gauges_are_tried_again_before_the_set_continues(make_rig):
    rig = make_rig(stations__trial_mm=1.0)
    with pytest.raises(LimitError, match="stop here"):
        await rig.run(at_step("P1/o04/sample", Mock(side_effect=LimitError("stop here"))))
    await run_until(rig, events.SetClosed)
    history = read_journal(rig.folder.journal)
    confirmed = next(n for n, event in enumerate(history) if isinstance(event, events.ReferenceConfirmed))
    after = [event.step.key for event in history[confirmed:] if isinstance(event, events.StepBegun)]
    assert after[:8] == [*["P1/o00/move", "P1/probe"] * 3, "P1/o01/move", "P1/try"]
    records = [event.orientation for event in history if isinstance(event, events.RecordTaken)][:9]
    assert records == [1, 2, 3, 4, 5, 6, 7, 8, 9]


def off_the_middle(gauge: Any, off_mm: float) -> Callable[[], None]:
    """Clamp a gauge by its stem elsewhere; gives how to put it right."""
    right = gauge.shown
    gauge.shown = lambda: right() + off_mm

    def correct() -> None:
        gauge.shown = right

    return correct


async def test_without_a_person_a_gauge_off_its_middle_ends_the_run_in_words(make_rig) -> None:
    rig = make_rig()
    off_the_middle(rig.gauges[1], -3.8)
    with pytest.raises(MountingError, match=r"stands [34]\.\d mm from the middle of its travel") as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert refusal.value.subject == "gauge y"
    assert "towards -y" in str(refusal.value)
    assert not happened(rig, events.RecordTaken)


@pytest.mark.parametrize(
    ("is_exchanged", "words"),
    [
        (True, "gauges x, y: are exchanged.*Exchange their cables"),
        (False, r"Move the gauge by .* along \+x"),
    ],
)
async def test_a_person_is_told_what_to_do_and_the_station_begins_again(make_rig, is_exchanged, words):
    rig = make_rig(stations__placement="by-hand", **({"stations__trial_mm": 1.0} if is_exchanged else {}))
    correct: Callable[[], None] = partial(corrected, rig)
    if is_exchanged:
        make_mistake(rig, "x and y exchanged")
    else:
        correct = off_the_middle(rig.gauges[0], 3.8)
    rig.operator.decisions = [Action.REDO_SET]
    policy = rig.cell.settings.recovery.attended
    await run_until(rig, events.GaugesPlaced, on(events.Failed, correct), count=3, policy=policy)
    (problem,) = rig.operator.problems
    assert re.search(words, problem)
    assert rig.operator.placed[:3] == [1, 1, 2], "the gauges were placed again"
    failed, _ = happened(rig, events.Failed)
    assert is_exchanged or failed.failure is FailureKind.MOUNTING


async def test_no_record_leaves_the_room_of_gauges_zeroed_off_the_middle(make_rig) -> None:
    rig = make_rig(simulation__gauges__placing_mm=0.0)
    for gauge, off_mm in zip(rig.gauges, (0.9, -0.9, 0.9), strict=True):
        off_the_middle(gauge, off_mm)
    await run_until(rig, events.SetClosed)
    assert not happened(rig, events.RecordRejected)
    for taken in happened(rig, events.RecordTaken):
        assert np.abs(taken.reading.gauges_mm).max() <= 5.0, "beyond the plates"
