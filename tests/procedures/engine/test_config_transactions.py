"""Which change of the config must be reverted when a run ends early or cannot be journalled."""

from __future__ import annotations

import pytest

from hexacell.errors import DeviceError, Interruption
from procedures.engine.recovery import Reversal, revert_at_end, revert_unrecorded
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.base import BaseStep
from procedures.steps.lend import Lend
from procedures.steps.roll_back import RollBack
from procedures.steps.take_back import TakeBack

ROLL_BACK, TAKE_BACK = RollBack(), TakeBack()
ZERO = (0.0, 0.0, 0.0)
APPLIED = events.ProvisionalApplied(
    geometry={"S": (ZERO,) * 6, "B": (ZERO,) * 6, "l": (0.0,) * 6}, folder="lent"
)
COMMITTED = events.Committed(approved_by="a tester")
FAILURE = DeviceError("is silent", subject="gauge x")


def arrived(orientation: int) -> events.Event:
    at = SetKey(phase=Phase.IDENTIFY, point=2)
    return events.Arrived(at=at, orientation=orientation, pose=(0.0,) * 6)


def step_at_end(history: list[events.Event], error: BaseException) -> BaseStep | None:
    reversal = revert_at_end(fold(history), error)
    return None if reversal is None else reversal.step


@pytest.mark.parametrize(
    ("history", "error", "step"),
    [
        ([], FAILURE, None),
        ([COMMITTED], FAILURE, ROLL_BACK),
        ([COMMITTED], Interruption("aborted"), None),
        ([COMMITTED], KeyboardInterrupt(), None),
        ([events.StepBegun(step=Lend())], Interruption("aborted"), TAKE_BACK),
        ([APPLIED], FAILURE, None),
        ([APPLIED, arrived(1)], FAILURE, TAKE_BACK),
        ([APPLIED, arrived(1)], KeyboardInterrupt(), TAKE_BACK),
        ([APPLIED, arrived(3)], FAILURE, None),
        ([APPLIED, events.StepBegun(step=TAKE_BACK)], FAILURE, TAKE_BACK),
        ([APPLIED, events.ProvisionalReverted(), arrived(1)], FAILURE, None),
    ],
)
def test_an_early_end_reverts_unverified_and_provisional_geometries(history, error, step):
    assert step_at_end(history, error) == step


def test_only_a_result_that_stays_in_the_controller_is_reported() -> None:
    result, provisional = (
        revert_at_end(fold([COMMITTED]), FAILURE),
        revert_at_end(fold([APPLIED, arrived(1)]), FAILURE),
    )
    assert result is not None
    assert provisional is not None
    assert result.failure == "the new geometry was not verified, and could not be taken back"
    assert not provisional.failure, "the resumed run reverts it"
    assert result.is_recorded
    assert provisional.is_recorded


@pytest.mark.parametrize(("event", "step"), [(COMMITTED, ROLL_BACK), (APPLIED, TAKE_BACK)])
def test_a_change_that_could_not_be_journalled_is_reverted(event: events.Event, step: BaseStep) -> None:
    reversal = revert_unrecorded(event, RunState())
    assert isinstance(reversal, Reversal)
    assert (reversal.step, reversal.is_recorded) == (step, False)
    assert revert_unrecorded(event, fold([event])) is None, "it is in the journal"
