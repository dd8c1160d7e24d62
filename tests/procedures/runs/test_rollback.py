"""A result that is worse, cannot be loaded or meets an edited config does not stay in the controller."""

from __future__ import annotations

import pytest

from drivers.errors import GaugeAtEnd
from hexacell.acceptance import HeldOutVerdict
from hexacell.errors import DeviceError, ExitCode, FileError, WriteBackUndone
from procedures.run import events
from tests.procedures.runs.listening import (
    before_sampling,
    commanding,
    happened,
    on,
    somebody_edits,
    with_tiny_deviations_before,
)


async def test_a_result_worse_than_before_is_rolled_back_bit_for_bit(recording, replayed) -> None:
    rig = replayed(with_tiny_deviations_before(recording.until(events.Proposed)))
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert ended.line.endswith("worse than before; rolled back, the controller has its old config")
    assert happened(rig, events.ResultValidated)[0].verdict is HeldOutVerdict.WORSE
    assert happened(rig, events.Committed)
    assert rig.config == recording.config_before
    assert rig.controller.log.count("reload") == 2
    assert commanding(rig).largest_difference(rig.calibration.robot.controller) == 0.0


async def test_a_better_result_out_of_limits_is_rolled_back(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed), acceptance__mean_deviation_mm=0.0001)
    assert (await rig.run()).exit_code == ExitCode.OUT_OF_LIMITS
    assert happened(rig, events.ResultValidated)[0].verdict is HeldOutVerdict.OUT_OF_LIMITS
    assert rig.config == recording.config_before


@pytest.mark.parametrize("key", ["after-V1/o01/sample", "after-V1/o02/sample", "after-V2/o03/sample"])
async def test_a_ball_outside_the_travel_at_verification_causes_a_rollback(
    recording, replayed, key: str
) -> None:
    rig = replayed(recording.until(events.Proposed))
    at_end = GaugeAtEnd("is at an end of its travel", subject="gauge x")
    fault = before_sampling(key, lambda: rig.gauges[0].failures.append(at_end))
    assert (await rig.run(fault)).exit_code == ExitCode.OUT_OF_LIMITS
    assert happened(rig, events.ResultValidated)[0].verdict is HeldOutVerdict.WORSE
    assert happened(rig, events.RolledBack)
    assert rig.config == recording.config_before


async def test_a_failed_reload_restores_the_config(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    rig.controller.failures["reload"] = DeviceError("does not come back", subject="controller")
    with pytest.raises(WriteBackUndone, match=r"did not take the new geometry .*is restored$") as undone:
        await rig.run()
    assert undone.value.exit_code is ExitCode.WRITE_BACK_UNDONE
    assert rig.config == recording.config_before
    assert rig.controller.log.count("reload") == 2, "the old config must be loaded again"
    assert not happened(rig, events.Committed)
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.WRITE_BACK_UNDONE


async def test_a_controller_that_cannot_reload_the_old_config_is_reported(
    recording, replayed, monkeypatch
) -> None:
    rig = replayed(recording.until(events.Proposed))

    async def broken() -> None:
        raise DeviceError("connection lost", subject="controller")

    monkeypatch.setattr(rig.controller, "reload", broken)
    with pytest.raises(WriteBackUndone, match="Restart the controller before it moves"):
        await rig.run()
    assert rig.config == recording.config_before


async def test_an_undone_write_back_can_be_repeated_by_resuming(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    rig.controller.failures["reload"] = DeviceError("does not come back", subject="controller")
    with pytest.raises(WriteBackUndone):
        await rig.run()
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert rig.config == recording.config_after


@pytest.mark.parametrize("stage", ["measuring", "proposed"])
async def test_a_config_edited_during_the_run_is_not_overwritten(recording, replayed, stage) -> None:
    kind, count = {"measuring": (events.SetClosed, 4), "proposed": (events.Proposed, 1)}[stage]
    rig = replayed(recording.until(kind, count=count))
    edited = somebody_edits(rig)
    rig.controller.log.clear()
    with pytest.raises(FileError, match="changed since the run began") as refusal:
        # The run's own beginning stands in the journal: the config that it knows.
        await rig.run()
    assert refusal.value.exit_code is ExitCode.USAGE
    assert rig.config == edited
    assert "reload" not in rig.controller.log


async def test_a_rollback_does_not_overwrite_an_edited_config(recording, replayed) -> None:
    rig = replayed(with_tiny_deviations_before(recording.until(events.Proposed)))
    edited: list[bytes] = []
    edit = on(events.ResultValidated, lambda: edited.append(somebody_edits(rig)))
    with pytest.raises(FileError, match="changed since it was written"):
        await rig.run(edit)
    assert [rig.config] == edited


async def test_an_interrupted_rollback_is_finished_on_resuming(recording, replayed) -> None:
    rig = replayed(with_tiny_deviations_before(recording.until(events.Proposed)))
    broken = DeviceError("does not come back", subject="controller")
    fault = on(events.ResultValidated, lambda: rig.controller.failures.update(reload=broken))
    with pytest.raises(DeviceError, match="does not come back"):
        await rig.run(fault)
    assert rig.config == recording.config_before
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert happened(rig, events.RolledBack)
    assert commanding(rig).largest_difference(rig.calibration.robot.controller) == 0.0
