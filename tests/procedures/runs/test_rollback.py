"""A result that is worse, cannot be loaded or meets an edited config is taken back; writes are recorded."""

from itertools import islice
from typing import Any

import pytest

from drivers.errors import GaugeAtEnd
from hexacell.config.write_record import RECORDS, THE_RUN, WriteKind, WriteRecord, read_records
from hexacell.errors import DeviceError, ExitCode, FileError, WriteBackUndone
from hexacell.noise.allowances import Allowances
from hexacell.verdict.decision import Verdict
from procedures.engine.commands import UnattendedOperator
from procedures.run.state import fold
from procedures.steps import events
from tests.procedures.runs import listening

CLEARLY_WORSE: dict[str, Any] = {"simulation__gauges__noise_mm": 0.01}
"""Deviations that are significant whatever noise is drawn."""


def recorded(run: Any) -> tuple[WriteRecord, ...]:
    """What is recorded of writes into the config, by a rig's run or the recorded one."""
    records, damaged = read_records(run.folder.siblings)
    assert not damaged
    return records


async def test_a_result_worse_than_before_is_rolled_back_bit_for_bit(recording, replayed) -> None:
    rig = replayed(listening.with_tiny_deviations_before(recording.until(events.Proposed)), **CLEARLY_WORSE)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert ended.line.endswith("(worse than before); rolled back, the controller has its old config")
    assert listening.happened(rig, events.ResultValidated)[0].verdict is Verdict.FAIL
    assert listening.happened(rig, events.Committed)
    assert ended.displacement is None, "nothing need be taught anew"
    assert rig.config == recording.config_before
    assert rig.controller.log.count("reload") == 2
    assert listening.commanding(rig).largest_difference(rig.calibration.robot.controller) == 0.0
    written, back = recorded(rig)
    assert (back.kind, back.by, back.run) == (WriteKind.TAKEN_BACK, THE_RUN, "run")
    assert back.why.endswith("(worse than before)")
    assert back.sha256_after == written.sha256_before
    assert back.largest is not None
    assert written.largest is not None
    assert back.largest.change == pytest.approx(-written.largest.change)


async def test_a_better_result_out_of_limits_is_rolled_back_if_nobody_keeps_it(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed), acceptance__position_mm=0.0001)
    rig.operator.name = None
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert ended.line.endswith("rolled back, the controller has its old config, the worse one")
    assert listening.happened(rig, events.ResultValidated)[0].verdict is Verdict.FAIL
    assert listening.happened(rig, events.ResultAccepted) == [events.ResultAccepted(by=None)]
    assert rig.config == recording.config_before


async def test_a_result_that_a_person_keeps_stays_although_the_run_is_killed_before_the_decision(
    recording, replayed
) -> None:
    rig = replayed(recording.until(events.Proposed), acceptance__position_mm=0.0001)
    with pytest.raises(listening.PowerCut):
        await rig.run(listening.on(events.ResultValidated, listening.cut_power))
    assert rig.config == recording.config_after
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert ended.line.endswith(": fail; kept by a tester")
    judged = listening.happened(rig, events.ResultValidated)[0]
    assert rig.operator.results == [judged.line]
    assert judged.verification.before_mm > judged.verification.after_mm
    proposed = fold(recording.history).proposed
    assert proposed is not None
    assert ended.displacement == proposed.displacement
    assert rig.config == recording.config_after


@pytest.mark.parametrize("attended", [True, False])
async def test_a_conditional_verdict_needs_a_person(recording, replayed, attended: bool) -> None:
    rig = replayed(recording.until(events.Proposed), acceptance__position_mm=limit_within(recording))
    if not attended:
        object.__setattr__(rig.performer, "operator", UnattendedOperator())
    ended = await rig.run()
    assert listening.happened(rig, events.ResultValidated)[0].verdict.is_conditional
    assert ended.exit_code == (ExitCode.DONE if attended else ExitCode.ANSWER_NEEDED)
    assert rig.config == (recording.config_after if attended else recording.config_before)
    assert rig.folder.proposal.exists()


def limit_within(recording: Any) -> float:
    """A limit that neither passes nor fails the recorded result, nor the same measured once more."""
    (judged,) = (event for event in recording.history if isinstance(event, events.ResultValidated))
    assert judged.verification is not None
    assert judged.verification.accuracy is not None
    position = judged.verification.accuracy.position
    return float(position.value)


@pytest.mark.parametrize(("scatters", "times", "stays"), [(False, 2, 0), (True, 3, 1), (True, 9, 0)])
async def test_a_ball_outside_the_travel_at_verification_rolls_back_unless_by_chance(
    recording, replayed, monkeypatch, scatters, times, stays
) -> None:
    monkeypatch.setattr(Allowances, "scatters", property(lambda _: scatters))
    rig = replayed(recording.until(events.Proposed))
    failures = iter(times * [GaugeAtEnd("is at an end of its travel", subject="gauge x")])
    fault = listening.at_step(
        "after-V2/o03/sample", lambda: rig.gauges[0].failures.extend(islice(failures, 1))
    )
    assert (await rig.run(fault)).exit_code == (ExitCode.DONE if stays else ExitCode.OUT_OF_LIMITS)
    assert (listening.happened(rig, events.ResultValidated)[0].verdict is not Verdict.FAIL) == stays
    assert (not listening.happened(rig, events.RolledBack)) == stays
    assert rig.config == (recording.config_after if stays else recording.config_before)


async def test_a_reading_that_could_not_be_taken_once_is_taken_again(recording, replayed) -> None:
    """The gauges show that their zero is as it was; the pose is measured then."""
    rig = replayed(recording.until(events.Proposed))
    at_ends = [GaugeAtEnd("is at an end of its travel", subject="gauge x")]

    def once() -> None:
        rig.gauges[0].failures.extend(at_ends)
        at_ends.clear()

    assert (await rig.run(listening.at_step("after-V1/o02/sample", once))).exit_code == ExitCode.DONE
    (refused,) = listening.happened(rig, events.RecordRejected)
    assert (str(refused.at), refused.orientation) == ("after-V1", 2)
    assert [event.at for event in listening.happened(rig, events.ReferenceConfirmed)] == [refused.at]
    assert listening.happened(rig, events.ResultValidated)[0].verdict is Verdict.PASS
    assert rig.config == recording.config_after


async def test_gauges_that_cannot_be_zeroed_are_no_verdict_on_the_new_geometry(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    at_end = GaugeAtEnd("is at an end of its travel", subject="gauge x")
    fault = listening.at_step("after-V1/o01/sample", lambda: rig.gauges[0].failures.append(at_end))
    with pytest.raises(WriteBackUndone, match="cannot be zeroed"):
        await rig.run(fault)
    assert not listening.happened(rig, events.ResultValidated)
    assert rig.config == recording.config_before, "nothing unverified stays"
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert rig.config == recording.config_after


async def test_a_failed_reload_restores_the_config(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    rig.controller.failures["reload"] = DeviceError("does not come back", subject="controller")
    with pytest.raises(WriteBackUndone, match=r"did not take the new geometry .*is restored$") as undone:
        await rig.run()
    assert undone.value.exit_code is ExitCode.WRITE_BACK_UNDONE
    assert rig.config == recording.config_before
    assert rig.controller.log.count("reload") == 2, "the old config must be loaded again"
    assert not listening.happened(rig, events.Committed)
    assert listening.happened(rig, events.Interrupted)[-1].exit_code == ExitCode.WRITE_BACK_UNDONE
    assert [one.kind for one in recorded(rig)] == [WriteKind.RESULT, WriteKind.TAKEN_BACK]
    assert "did not take it: controller: does not come back" in recorded(rig)[-1].why
    assert (await rig.run()).exit_code == ExitCode.DONE, "resumed, it is written"
    assert rig.config == recording.config_after


async def test_a_controller_that_cannot_reload_the_old_config_is_reported(recording, replayed, monkeypatch):
    rig = replayed(recording.until(events.Proposed))

    async def broken(_: object) -> None:
        raise DeviceError("connection lost", subject="controller")

    monkeypatch.setattr(rig.controller, "reload", broken)
    with pytest.raises(WriteBackUndone, match="Restart the controller before it moves"):
        await rig.run()
    assert rig.config == recording.config_before


async def test_a_config_edited_during_the_run_is_not_overwritten(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    edited = listening.somebody_edits(rig)
    rig.controller.log.clear()
    with pytest.raises(FileError, match="changed since the run began") as refusal:
        # The run's own beginning stands in the journal: the config that it knows.
        await rig.run()
    assert refusal.value.exit_code is ExitCode.USAGE
    assert rig.config == edited
    assert "reload" not in rig.controller.log


async def test_an_interrupted_rollback_is_finished_on_resuming(recording, replayed) -> None:
    rig = replayed(listening.with_tiny_deviations_before(recording.until(events.Proposed)), **CLEARLY_WORSE)
    broken = DeviceError("does not come back", subject="controller")
    fault = listening.on(events.ResultValidated, lambda: rig.controller.failures.update(reload=broken))
    with pytest.raises(DeviceError, match="does not come back"):
        await rig.run(fault)
    assert rig.config == recording.config_before
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert listening.happened(rig, events.RolledBack)
    assert listening.commanding(rig).largest_difference(rig.calibration.robot.controller) == 0.0


def test_a_result_is_recorded(recording) -> None:
    (written,) = recorded(recording)
    within_limits = "the cell file: within its limits"
    assert (written.kind, written.by, written.run) == (WriteKind.RESULT, within_limits, "run")
    assert [file.parent for file in written.files] == [recording.folder.path.parent]
    assert written.numbers_changed is not None
    assert written.numbers_changed > 30
    assert written.largest is not None


async def test_a_run_goes_on_where_nothing_can_be_recorded(recording, replayed, caplog) -> None:
    rig = replayed(recording.until(events.Proposed))
    (rig.folder.siblings / RECORDS).mkdir()
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert rig.config == recording.config_after
    (warning,) = caplog.messages
    assert warning.startswith("The config is written, but the history has no record of it: ")
