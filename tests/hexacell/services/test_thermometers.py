"""Thermometers of a cell file, from their files to the journal; their failures never end a run."""

import logging
from pathlib import Path

from hexacell.cell.devices import ThermometerSettings
from hexacell.services.run.replay_run import replay
from procedures.calibration.calibration import Mode
from procedures.replay.replayer import Scope
from procedures.steps import events


def in_the_room(tmp_path: Path) -> ThermometerSettings:
    path = tmp_path / "temp1_input"
    path.write_text("20125\n")
    return ThermometerSettings(name="room", path=str(path))


async def test_temperatures_are_in_the_journal_and_do_not_change_its_replay(
    make_site, tmp_path, caplog
) -> None:
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
