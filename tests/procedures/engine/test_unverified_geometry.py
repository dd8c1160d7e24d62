"""A new geometry that cannot be verified: taken back, written again, or verified on resuming."""

from __future__ import annotations

from typing import Any

import pytest

from hexacell.errors import (
    DeviceError,
    ExitCode,
    Interruption,
    SeveralErrors,
    WriteBackUndone,
)
from procedures.engine.commands import Abort
from procedures.engine.recovery import GIVE_UP
from procedures.journal.journal import read_journal
from procedures.run.state import RunState, fold
from procedures.steps import events
from tests.procedures.engine.injected_failures import (
    UNATTENDED,
    failing,
)
from tests.procedures.runs.listening import happened


@pytest.fixture
def rig(recording, replayed) -> Any:
    return replayed(recording.until(events.Proposed))


def slip_farther(rig: Any) -> Any:
    """Every time the last set is about to be closed, a gauge slips farther."""
    real, slipped = rig.gauges[2].shown, [0.0]
    rig.gauges[2].shown = lambda: real() + slipped[0]

    def farther() -> None:
        slipped[0] += 0.3

    return failing("after-V2/close", farther, 100)


@pytest.mark.parametrize("policy", [GIVE_UP, UNATTENDED])
async def test_a_geometry_that_cannot_be_verified_is_rolled_back(rig, recording, policy):
    sound = rig.gauges[2].shown
    with pytest.raises(WriteBackUndone, match=r"could not be verified; .* back\. after-V2: ") as undone:
        await rig.run(slip_farther(rig), policy=policy)
    assert undone.value.exit_code is ExitCode.WRITE_BACK_UNDONE
    assert rig.config == recording.config_before
    assert rig.controller.log.count("reload") == 2
    last = read_journal(rig.folder.journal)[-2:]
    assert [event.kind for event in last] == ["rolled back", "interrupted"]
    assert last[1] == events.Interrupted(reason=str(undone.value), exit_code=6)
    rig.gauges[2].shown = sound
    assert (await rig.run()).exit_code == ExitCode.DONE, "resumed, it is written again"
    assert rig.config == recording.config_after
    assert len(happened(rig, events.Committed)) == 2


async def test_a_geometry_stays_in_the_controller_after_an_abort_and_is_verified_on_resuming(
    rig, recording
) -> None:
    abort = failing("after-V2/close", lambda: rig.engine.command(Abort()))
    with pytest.raises(Interruption):
        await rig.run(abort)
    assert rig.config == recording.config_after
    assert fold(read_journal(rig.folder.journal)).is_unverified
    assert (await rig.run()).exit_code == ExitCode.DONE


async def test_a_geometry_is_written_again_on_resuming_after_a_failed_rollback(rig, recording) -> None:
    slip = slip_farther(rig)
    rig.controller.failures = {}

    def break_down(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.StepBegun) and event.step.key == "roll back":
            rig.controller.failures["reload"] = DeviceError("does not come back", subject="controller")

    with pytest.raises(SeveralErrors, match="could not be taken back") as both:
        await rig.run(slip, break_down)
    assert both.value.exit_code is ExitCode.HARDWARE
    assert rig.config == recording.config_before
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    assert rig.config == recording.config_after
