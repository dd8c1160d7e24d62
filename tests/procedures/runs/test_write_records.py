"""What a run writes into the config is recorded: its result, and what it takes back by itself."""

from __future__ import annotations

from typing import Any

import pytest

from hexacell.config.write_record import RECORDS, THE_RUN, WriteKind, WriteRecord, read_records
from hexacell.errors import DeviceError, ExitCode, WriteBackUndone
from procedures.steps import events
from tests.procedures.runs.listening import with_tiny_deviations_before
from tests.procedures.runs.test_rollback import CLEARLY_WORSE

WITHIN_LIMITS = "the cell file: within its limits"


def recorded(rig: Any) -> tuple[WriteRecord, ...]:
    records, damaged = read_records(rig.folder.siblings)
    assert not damaged
    return records


async def test_a_result_is_recorded(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    assert (await rig.run()).exit_code == ExitCode.DONE
    (written,) = recorded(rig)
    assert (written.kind, written.by, written.run) == (WriteKind.RESULT, WITHIN_LIMITS, "run")
    assert written.files == rig.cell.config_paths
    assert written.numbers_changed is not None
    assert written.numbers_changed > 30
    assert written.largest is not None


async def test_a_worse_result_is_recorded_with_its_rollback(recording, replayed) -> None:
    rig = replayed(with_tiny_deviations_before(recording.until(events.Proposed)), **CLEARLY_WORSE)
    await rig.run()
    written, back = recorded(rig)
    assert (back.kind, back.by, back.run) == (WriteKind.TAKEN_BACK, THE_RUN, "run")
    assert back.why.endswith("(worse than before)")
    assert back.sha256_after == written.sha256_before
    assert back.largest is not None
    assert written.largest is not None
    assert back.largest.change == pytest.approx(-written.largest.change)


async def test_a_controller_that_does_not_take_it_is_the_reason(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    rig.controller.failures["reload"] = DeviceError("does not come back", subject="controller")
    with pytest.raises(WriteBackUndone):
        await rig.run()
    assert [one.kind for one in recorded(rig)] == [WriteKind.RESULT, WriteKind.TAKEN_BACK]
    assert "did not take it: controller: does not come back" in recorded(rig)[-1].why


async def test_a_run_goes_on_where_nothing_can_be_recorded(recording, replayed, caplog) -> None:
    rig = replayed(recording.until(events.Proposed))
    (rig.folder.siblings / RECORDS).mkdir()
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert rig.config == recording.config_after
    (warning,) = caplog.messages
    assert warning.startswith("The config is written, but the history has no record of it: ")
