"""A config that changes during a run: what is reverted at an early end, edits, geometries not verified."""

from typing import Any

import pytest

from hexacell.errors import DeviceError, ExitCode, FileError, Interruption, SeveralErrors, WriteBackUndone
from procedures.engine.commands import Abort, UnattendedOperator
from procedures.engine.recovery import Reversal, revert_at_end, revert_unrecorded
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.base import BaseStep
from procedures.steps.lend import Lend
from procedures.steps.roll_back import RollBack
from procedures.steps.take_back import TakeBack
from tests.procedures.runs.listening import UNATTENDED, failing, happened, on, run_until

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
    reversal = revert_at_end(fold(history), error)
    assert (reversal.step if reversal else None) == step


@pytest.mark.parametrize(("event", "step"), [(COMMITTED, ROLL_BACK), (APPLIED, TAKE_BACK)])
def test_a_change_that_could_not_be_journalled_is_reverted(event: events.Event, step: BaseStep) -> None:
    reversal = revert_unrecorded(event, RunState())
    assert isinstance(reversal, Reversal)
    assert (reversal.step, reversal.is_recorded) == (step, False)
    assert revert_unrecorded(event, fold([event])) is None, "it is in the journal"


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


async def test_a_geometry_that_cannot_be_verified_is_rolled_back(rig, recording) -> None:
    sound = rig.gauges[2].shown
    with pytest.raises(WriteBackUndone, match=r"could not be verified; .* back\. after-V2: ") as undone:
        await rig.run(slip_farther(rig), policy=UNATTENDED)
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
    abort = failing("after-V2/close", lambda: rig.engine.queue.put(Abort()))
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


def edits(rig: Any, kind: type[Any], count: int) -> Any:
    """A listener that changes the seventh line of the config at an event."""
    path = rig.cell.config_path
    lines = path.read_bytes().split(b"\n")

    def edit() -> None:
        path.write_bytes(b"\n".join([*lines[:6], b"# " + lines[6], *lines[7:]]))

    return on(kind, edit, count)


async def test_an_edit_is_noticed_before_the_next_move_and_the_file_and_line_are_named(make_rig) -> None:
    rig = make_rig()
    with pytest.raises(FileError, match="Undo the edit and retry") as noticed:
        await rig.run(edits(rig, events.RecordTaken, 3))
    assert str(noticed.value).startswith(f"{rig.cell.config_path}:7: the config changed since")
    assert noticed.value.exit_code is ExitCode.USAGE
    taken = happened(rig, events.RecordTaken)
    assert len(taken) == 3
    assert len([entry for entry in rig.controller.log if entry.startswith("move")]) == 3


async def test_an_unattended_run_ends_and_is_resumed_once_the_edit_is_undone(recording, replayed) -> None:
    rig = replayed(recording.until(events.SetClosed), operator=UnattendedOperator())
    before = rig.config
    policy = rig.cell.settings.recovery.unattended
    with pytest.raises(FileError, match="Undo the edit"):
        await rig.run(edits(rig, events.RecordTaken, 2), policy=policy)
    log = list(rig.controller.log)
    with pytest.raises(FileError, match="Undo the edit"):
        await rig.run(policy=policy)
    assert rig.controller.log[len(log) :] == ["stop"], "not even prepared"
    rig.cell.config_path.write_bytes(before)
    rig.operator.name = None
    await run_until(rig, events.SetClosed, policy=policy)


async def test_an_edited_provisional_config_is_not_loaded_in_place_of_the_old_one(recording, replayed):
    rig = replayed(recording.until(events.SetClosed), identification__provisional=True)
    with pytest.raises(FileError, match="Undo the edit and retry"):
        await rig.run(edits(rig, events.SetClosed, 1))
    assert rig.controller.log.count("reload") == 1, "the provisional geometry alone was loaded"
