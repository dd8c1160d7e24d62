"""Devices unplugged and plugged in again, mistakes with gauges, thermometers that fail."""

import logging
from dataclasses import replace
from pathlib import Path

import pytest

from drivers.errors import ConnectionLost
from hexacell.cell.devices import ThermometerSettings
from hexacell.cell.recovery import Action
from hexacell.cell.simulation import FaultKind, SimulatedFault
from hexacell.errors import ExitCode, HexacellError, Interruption
from hexacell.services.run.replay_run import replay
from procedures.calibration.calibration import Mode
from procedures.devices.reconnection import DeviceReplaced
from procedures.replay.replayer import Scope
from procedures.steps import events
from tests.procedures.runs.listening import failing, on, stop_here

UNPLUGGED: FaultKind = "unplugged"


@pytest.mark.parametrize(
    ("kind", "device", "step", "voids"),
    [
        (UNPLUGGED, "x", "P2/o03/sample", True),
        pytest.param(UNPLUGGED, "z", "P2/o03/move", True, marks=pytest.mark.slow),
        pytest.param(UNPLUGGED, "encoder 3", "P2/o03/sample", True, marks=pytest.mark.slow),
    ],
)
async def test_an_unplugged_device_that_is_plugged_in_again_is_recovered(
    finished, make_site, kind, device, step, voids
) -> None:
    site = make_site()
    site.write(finished.until(events.SetClosed), finished)
    pull_out = failing(step, lambda: site.simulated.faults.inject(kind, device))
    plug_in = on(events.Failed, lambda: site.simulated.faults.clear(kind, device), count=None)
    with pytest.raises(Interruption):
        await site.calibrate(pull_out, plug_in, on(events.SetClosed, stop_here), resume=True)
    failures = site.happened(events.Failed)
    assert failures
    assert all(failure.action is not Action.ABORT for failure in failures)
    voided = [str(event.at) for event in site.happened(events.SetInvalidated)]
    assert ("P2" in voided) == voids, "what was opened again has lost its zero"


async def test_without_its_controller_nothing_is_begun_and_the_same_order_works_once_it_is_there(make_site):
    site = make_site()
    before = site.config
    site.simulated.faults.inject(UNPLUGGED, "controller")
    with pytest.raises(ConnectionLost) as refusal:
        await site.calibrate()
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert (site.folder.path.exists(), site.config) == (False, before)
    site.simulated.faults.clear(UNPLUGGED, "controller")
    with pytest.raises(Interruption):
        await site.calibrate(on(events.RecordTaken, stop_here))
    assert len(site.happened(events.RecordTaken)) == 1


async def test_another_device_than_the_run_was_begun_with_is_refused(finished, make_site) -> None:
    site = make_site()
    history = list(finished.until(events.SetClosed))
    devices = [
        replace(device, serial_number="4711") if device.protocol == "cia406" else device
        for device in history[0].devices
    ]
    history[0] = history[0].model_copy(update={"devices": tuple(devices)})
    site.write(history, finished)
    with pytest.raises(DeviceReplaced, match="serial number 4711") as refusal:
        await site.calibrate(resume=True)
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert site.happened(events.StepBegun) == [e for e in history if isinstance(e, events.StepBegun)]


MISTAKES: list[tuple[FaultKind, str, str, int]] = [
    ("reversed", "x", "gauge x: counts the wrong way", 1),
    ("exchanged", "y", "gauges y, z: are exchanged", 1),
    ("frozen", "z", "gauge z: does not follow the ball", 1),
    ("in inches", "x", "gauge x: answers in inch", 0),
    ("off its middle", "y", r"gauge y: its plunger stands [34]\.\d mm from the middle", 0),
]
"""What, of which gauge, what is said, and how many records were taken before."""


@pytest.mark.parametrize(("kind", "gauge", "words", "records"), MISTAKES)
async def test_a_mistake_at_the_start_is_named(make_site, kind, gauge, words, records) -> None:
    fault = SimulatedFault(kind=kind, device=gauge)
    site = make_site(stations__trial_mm=1.0, simulation__faults=(fault,))
    with pytest.raises(HexacellError, match=words) as refusal:
        await site.calibrate()
    assert refusal.value.exit_code is ExitCode.HARDWARE
    taken = site.happened(events.RecordTaken) if site.folder.journal.exists() else []
    assert len(taken) == records


def in_the_room(tmp_path: Path) -> ThermometerSettings:
    path = tmp_path / "temp1_input"
    path.write_text("20125\n")
    return ThermometerSettings(name="room", path=str(path))


@pytest.mark.slow
async def test_temperatures_are_in_the_journal_and_do_not_change_its_replay(make_site, tmp_path, caplog):
    nowhere = ThermometerSettings(name="rails", path=str(tmp_path / "nowhere"))
    site = make_site(thermometers=(in_the_room(tmp_path), nowhere))
    with caplog.at_level(logging.WARNING):
        await site.calibrate(mode=Mode.CHECK)
    [warning] = [record.getMessage() for record in caplog.records if "thermometer" in record.getMessage()]
    assert warning.startswith("thermometer rails: cannot be read: it does not exist")
    [started] = site.happened(events.RunStarted)
    assert [one.name for one in started.devices if one.protocol == "sysfs"] == ["thermometer room"]
    for sampled in site.happened(events.RecordTaken):
        room, rails = sampled.reading.temperatures
        assert (room.name, room.celsius, room.raw, room.problem) == ("room", 20.125, "20125", "")
        assert (rails.name, rails.celsius) == ("rails", None)
        assert rails.problem.startswith("thermometer rails: cannot be read")
    replayed = await replay(site.folder.path, Scope.RESULTS)
    assert replayed.differences == []
