"""``hexacell schedule``: writes, shows and removes units of its own, and no others."""

from pathlib import Path

import pytest

from hexacell.services.unattended import scheduled_run

UNITS = ["hexacell-simulated-hexaglide.service", "hexacell-simulated-hexaglide.timer"]


@pytest.fixture
def units(tmp_path):
    return tmp_path / "units"


@pytest.fixture
def schedule(typed_here, cell_folder, units):
    return lambda *words: typed_here("schedule", cell_folder.cell, *words, "--folder", units)


def test_written_shown_and_removed(schedule, cell_folder, units) -> None:
    before = cell_folder.snapshot()
    written = schedule("--daily", "02:30")
    assert written.code == 0, written.err
    assert sorted(path.name for path in units.iterdir()) == UNITS
    assert "Each day at 02:30 a check begins. It measures a few records and changes nothing." in written.out
    assert "enable --now hexacell-simulated-hexaglide.timer" in written.out
    assert "systemd:" not in written.out
    shown = schedule("--show")
    assert "OnCalendar=*-*-* 02:30:00" in shown.out
    assert schedule("--daily", "03:00", "--mode", "optimise", "--json").document == {
        "unit": "hexacell-simulated-hexaglide",
        "files": [str(units / name) for name in UNITS],
        "complaints": [],
    }
    assert "OnCalendar=*-*-* 03:00:00" in schedule("--show").out
    (units / "timers.target.wants").mkdir()
    (units / "timers.target.wants" / UNITS[1]).symlink_to(units / UNITS[1])
    assert schedule("--remove").code == 0
    assert [path for path in units.rglob("*") if not path.is_dir()] == []
    for again in ("--remove", "--show"):
        assert "This cell has no schedule." in schedule(again).out
    assert cell_folder.snapshot() == before


def test_a_cell_with_another_name_still_has_one_schedule(schedule, cell_folder, units) -> None:
    assert schedule("--daily", "02:30").code == 0
    cell_folder.edit(('name = "simulated-hexaglide"', 'name = "hall 4"'))
    assert schedule("--daily", "03:30").code == 0
    assert sorted(path.name for path in units.iterdir()) == [
        "hexacell-hall-4.service",
        "hexacell-hall-4.timer",
    ]


def test_a_service_that_could_not_begin_is_not_written(schedule, units, tmp_path) -> None:
    """systemd refuses one with a writable path that does not exist."""
    refused = schedule("--daily", "02:30", "--metrics", tmp_path / "nowhere" / "cell.prom")
    assert (refused.code, "the folder of the metrics does not exist" in refused.err) == (2, True)
    assert not units.exists()


def test_a_service_leaves_a_run_the_time_that_the_cell_file_gives_it(schedule, cell_folder, units) -> None:
    given = '[unattended]\nquiet_hours = ["09:00-10:00"]\n'
    cell_folder.cell.write_text(f"{cell_folder.cell.read_text()}\n{given}")
    for stated, longest, tries in (
        ("", 120, 4),
        ("longest_minutes = 90", 120, 4),
        ("longest_minutes = 600.5", 611, 2),
        ("window_minutes = 60", 180, 1),
        ("window_minutes = 60\nlongest_minutes = 300", 370, 1),
    ):
        cell_folder.edit((given, f"{given}{stated}\n"))
        assert schedule("--daily", "02:30").code == 0
        service = (units / UNITS[0]).read_text()
        assert f"TimeoutStartSec={longest}min\n" in service
        assert f"StartLimitBurst={tries}\n" in service
        cell_folder.edit((f"{given}{stated}\n", given))
    refused = schedule("--daily", "09:30")
    assert (refused.code, "09:30 is in the quiet hours of the cell" in refused.err) == (2, True)
    cell_folder.edit((given, f"{given}longest_minutes = 1430\n"))
    refused = schedule("--daily", "02:30")
    assert (refused.code, "it may last longer than a day" in refused.err) == (2, True)


def test_units_of_others_are_left_alone(schedule, units) -> None:
    units.mkdir()
    other = units / UNITS[0]
    for content in ("[Unit]\n", "# Written by `hexacell schedule` for /elsewhere/cell.toml\n"):
        other.write_text(content)
        outcome = schedule("--daily", "02:30")
        assert (outcome.code, str(other) in outcome.err) == (2, True)
        schedule("--remove")
        assert [(path.name, path.read_text()) for path in units.iterdir()] == [(UNITS[0], content)]


def test_a_cell_that_needs_a_person_is_not_scheduled(schedule, cell_folder, units) -> None:
    cell_folder.edit(('placement = "fixed"', 'placement = "by-hand"'))
    outcome = schedule("--daily", "02:30")
    assert outcome.code == 2
    assert "unattended running is not possible: the gauges are put at each point by hand" in outcome.err
    assert not units.exists()


def test_what_makes_no_sense_is_refused(schedule, units) -> None:
    for words, problem in (
        (["--daily", "25:00"], "'25:00' is no time of day"),
        ([], "the time of day is missing"),
        (["--daily", "02:30", "--show"], "not allowed with"),
    ):
        outcome = schedule(*words)
        assert (outcome.code, problem in outcome.err) == (2, True)
    assert not units.exists()


@pytest.mark.parametrize(
    ("zone", "daily", "other"),
    [
        ("Europe/Berlin", "02:30", "03:30"),
        ("Australia/Lord_Howe", "02:15", "03:15"),
        ("Europe/Berlin", "01:59", None),
        ("", "02:30", None),
    ],
)
def test_a_time_that_one_night_does_not_have_is_warned_of(schedule, monkeypatch, zone, daily, other):
    if not (zones := Path("/usr/share/zoneinfo")).is_dir():
        pytest.skip("there are no time zones here")
    monkeypatch.setattr(scheduled_run, "LOCAL_TIME", zones / zone)
    outcome = schedule("--daily", daily)
    assert outcome.code == 0
    assert ("is not there on 20" in outcome.err) == (other is not None)
    assert other is None or f"Take {other}, or" in outcome.err
