"""A calibration from the cell file to its end, through real drivers and files."""

import asyncio
import shutil

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.config.layout import fingerprint
from hexacell.errors import CellBusy, ExitCode, FileError, UsageError
from hexacell.runs.cell_lock import cell_lock
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.run.accepted_results import last_accepted_result
from hexacell.services.run.calibration_run import calibrate
from hexacell.services.run.replay_run import replay
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Mode
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase
from procedures.run.state import fold
from procedures.steps import events


def test_a_calibration_passes_and_listeners_get_the_events_of_the_journal(finished) -> None:
    assert finished.ended.exit_code == ExitCode.DONE
    assert "35 parameters, 24 records at 2 points; mean deviation at held-out poses" in finished.ended.line
    state = fold(finished.history)
    assert state.judged
    assert state.judged.verdict is Verdict.PASS
    before, after = (np.linalg.norm(state.held_out(phase), axis=1) for phase in (Phase.BEFORE, Phase.AFTER))
    assert before.mean() > 1.0
    assert after.mean() < 0.2
    assert finished.told == finished.history


def test_the_first_event_has_the_inputs_of_the_run(finished) -> None:
    started = finished.history[0]
    assert started.cell == "simulated-hexaglide"
    assert started.cell_text == finished.cell.text
    assert started.config_sha256 != fingerprint(finished.cell.config_path)
    assert started.controller == finished.cell.settings.robot.nominal.model_dump()
    assert started.branch == (-1, -1, -1, 1, 1, 1)
    protocols = [device.protocol for device in started.devices]
    assert protocols == ["sylvac", "mux10", "cdi", *["cia406"] * 6, "linuxcncrsh"]
    assert len({device.serial_number for device in started.devices if device.protocol == "cia406"}) == 6


async def test_a_folder_with_a_run_takes_no_new_one_and_what_is_over_is_not_resumed(finished) -> None:
    before = finished.folder.journal.read_bytes()
    with pytest.raises(UsageError, match="is over: 35 parameters"):
        await calibrate(finished.order(resume=True))
    with pytest.raises(UsageError, match="holds a run already"):
        await calibrate(finished.order())
    assert finished.folder.journal.read_bytes() == before


@pytest.mark.slow
async def test_the_cell_is_held_while_it_runs_and_free_afterwards(make_site, finished) -> None:
    site = make_site()
    site.write(finished.until(events.Proposed), finished)
    busy: list[bool] = []

    def listener(event: events.Event, _: object) -> None:
        if isinstance(event, events.Committed):
            with pytest.raises(CellBusy), cell_lock(site.cell.config_path):
                pass
            busy.append(True)

    with cell_lock(site.cell.config_path), pytest.raises(CellBusy) as refusal:
        await site.calibrate(resume=True)
    assert refusal.value.exit_code is ExitCode.BUSY
    await site.calibrate(listener, resume=True)
    assert busy == [True]
    assert site.config == finished.cell.config_path.read_bytes()
    with cell_lock(site.cell.config_path):
        pass


async def test_after_a_calibration_a_check_finds_it_good(finished, tmp_path) -> None:
    before = finished.cell.config_path.read_bytes()
    order = finished.order(folder=RunFolder(tmp_path / "check"), mode=Mode.CHECK)
    ended = await calibrate(order)
    assert ended.exit_code == ExitCode.DONE
    assert finished.cell.config_path.read_bytes() == before
    told = fold(read_journal(order.folder.journal))
    assert told.started is not None
    assert told.started.accepted is not None
    assert told.started.accepted.run == str(finished.folder.path)
    assert told.judged is not None
    assert told.judged.check is not None
    assert told.judged.check.drift_scale == 1.0
    assert (await replay(order.folder.path)).differences == []


async def test_the_effects_of_an_accepted_result_are_those_of_its_records(make_cell, finished) -> None:
    cell = make_cell(uncertainty__encoder_scale_um_m=100.0)
    cell.config_path.write_bytes(finished.cell.config_path.read_bytes())
    shutil.copytree(runs_folder(finished.cell), runs_folder(cell))
    found = last_accepted_result(cell)
    assert found is not None
    assert list(found.effects) == ["scale of each encoder"]
    columns = found.parameter_columns["scale of each encoder"]
    # Of 1 um/m over some 300 mm of travel, in parameters that the records determine.
    assert columns.shape == (35, 6)
    assert 1e-4 < np.abs(columns).max() < 1e-1


async def test_a_run_without_a_beginning_cannot_be_resumed(make_site) -> None:
    site = make_site()
    with pytest.raises(FileError, match="does not exist"):
        await site.calibrate(resume=True)
    site.folder.path.mkdir()
    site.folder.journal.touch()
    with pytest.raises(FileError, match="journal is empty"):
        await site.calibrate(resume=True)


async def test_a_run_is_resumed_with_the_cell_file_it_began_with(make_site, finished) -> None:
    site = make_site()
    site.write(finished.until(events.RecordTaken), finished)
    site.cell.path.write_text(site.cell.text.replace("position_mm = ", "position_mm = 1", 1))
    site.cell = load_cell(site.cell.path)
    with pytest.raises(UsageError, match="has changed since the run began"):
        await site.calibrate(resume=True)


async def test_a_run_is_resumed_as_what_it_was_begun(make_site, finished) -> None:
    site = make_site()
    site.write(finished.until(events.RecordTaken), finished)
    with pytest.raises(UsageError, match="begun in the mode optimise"):
        await site.calibrate(resume=True, mode=Mode.CHECK)
    with pytest.raises(UsageError, match="begun without a length check"):
        await site.calibrate(resume=True, length_check=True)


@pytest.mark.slow
async def test_a_cancelled_run_stops_in_place_and_can_be_resumed(make_site, finished) -> None:
    site = make_site()
    site.write(finished.until(events.SetClosed), finished)
    heard = 0

    def cancel(event: events.Event, _: object) -> None:
        nonlocal heard
        heard += isinstance(event, events.RecordTaken)
        if heard >= 3:
            running.cancel()  # again and again, until it is over

    running = asyncio.create_task(site.calibrate(cancel, resume=True))
    with pytest.raises(asyncio.CancelledError):
        await running
    assert site.happened(events.Interrupted)[-1] == events.Interrupted(
        reason="CancelledError", exit_code=ExitCode.INTERRUPTED
    )
    assert site.simulated.physics.progress() == 1.0
    first, wire = read_journal(site.folder.journal), site.folder.wire.read_bytes()

    ended = await site.calibrate(resume=True)
    assert ended.exit_code == ExitCode.DONE
    history = read_journal(site.folder.journal)
    assert history[: len(first)] == first
    assert [str(event.at) for event in site.happened(events.ReferenceConfirmed)] == ["P2"]
    assert not site.happened(events.SetInvalidated), "the gauges stood there all the time"
    assert site.folder.wire.read_bytes() == wire
    assert (site.folder.path / "wire-2").exists()
