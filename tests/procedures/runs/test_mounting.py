"""Gauges that are zeroed far from the middle of their travel: mounted again, or refused in words."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hexacell.cell.recovery import Action, FailureKind
from hexacell.errors import ExitCode
from procedures.engine.recovery import RecoveryPolicy
from procedures.steps import events
from procedures.steps.place import MountingError
from tests.procedures.runs.listening import happened, on, run_until

OFF_MM = 3.8


def off_the_middle(gauge: Any, off_mm: float) -> Callable[[], None]:
    """Clamp a gauge by its stem elsewhere; gives how to put it right."""
    right = gauge.shown
    gauge.shown = lambda: right() + off_mm

    def correct() -> None:
        gauge.shown = right

    return correct


async def test_without_a_person_a_gauge_off_its_middle_ends_the_run_in_words(make_rig) -> None:
    rig = make_rig()
    off_the_middle(rig.gauges[1], -OFF_MM)
    with pytest.raises(MountingError, match=r"stands [34]\.\d mm from the middle of its travel") as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert refusal.value.subject == "gauge y"
    assert "towards -y" in str(refusal.value)
    assert not happened(rig, events.RecordTaken)


async def test_a_person_is_told_how_to_move_the_gauge_and_the_set_begins_again(make_rig) -> None:
    rig = make_rig(stations__placement="by-hand")
    correct = off_the_middle(rig.gauges[0], OFF_MM)
    rig.operator.decisions = [Action.REDO_SET]
    policy = RecoveryPolicy.of(rig.cell.settings.recovery, attended=True)
    await run_until(rig, events.GaugesPlaced, on(events.Failed, correct), count=3, policy=policy)
    (problem,) = rig.operator.problems
    assert "Move the gauge by " in problem
    assert "along +x" in problem
    assert rig.operator.placed[:3] == [1, 1, 2], "the gauges were placed again"
    (failed,) = happened(rig, events.Failed)
    assert failed.failure is FailureKind.MOUNTING


async def test_no_record_leaves_the_room_of_gauges_zeroed_off_the_middle(make_rig) -> None:
    rig = make_rig(simulation__gauges__placing_mm=0.0)
    for gauge, off_mm in zip(rig.gauges, (0.9, -0.9, 0.9), strict=True):
        off_the_middle(gauge, off_mm)
    await run_until(rig, events.Identified)
    assert not happened(rig, events.RecordRejected)
    for taken in happened(rig, events.RecordTaken):
        assert np.abs(taken.reading.gauges_mm).max() <= 5.0, "beyond the plates"
