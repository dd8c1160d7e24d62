"""What systemd is told of a cell's nights, and the quiet hours in which none begins."""

import shlex
import shutil
import subprocess
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hexacell.cell.operation import UnattendedSettings
from hexacell.errors import UsageError
from hexacell.services.unattended.scheduled_run import (
    MARK,
    ScheduledRun,
    service_text,
    time_of_day,
    timer_text,
)
from hexacell.services.unattended.unattended_runs import next_quiet, quiet_until

PRINTABLE = st.text(
    st.characters(categories=["L", "N", "P", "S", "Zs"], exclude_characters="/"), min_size=1, max_size=20
).filter(str.isprintable)


def scheduled(
    cell: str = "/cells/my-robot/cell.toml", name: str = "my-robot", retries: int = 3
) -> ScheduledRun:
    path = Path(cell)
    program = ("/usr/bin/python3", "-m", "hexacell")
    return ScheduledRun(path, name, program, "check", 2, 30, 120, retries, (path.parent,))


def settings_of(unit: str) -> dict[str, str]:
    return dict(line.split("=", 1) for line in unit.splitlines() if "=" in line)


def words_of(line: str) -> list[str]:
    """The words of a command line as systemd reads them: quoted, with escapes, %% and $$."""
    words = shlex.split(line, posix=True)
    return [word.replace("%%", "%").replace("$$", "$") for word in words]


def test_a_night_is_a_check_once_and_what_may_pass_is_tried_again() -> None:
    found = settings_of(service_text(scheduled(), "robot", ["dialout"]))
    assert found["Type"] == "oneshot"
    assert words_of(found["ExecStart"])[3:] == [
        "run", "/cells/my-robot/cell.toml", "--unattended", "--mode", "check",
    ]  # fmt: skip
    assert found["RestartPreventExitStatus"].split() == ["1", "2", "4", "6", "7", "70", "130", "SIGTERM"]
    assert (found["StartLimitBurst"], found["StartLimitIntervalSec"]) == ("4", "540min")
    assert (found["User"], found["SupplementaryGroups"]) == ("robot", "dialout")
    assert found["NoNewPrivileges"] == "yes"
    assert found["ReadWritePaths"] == '"/cells/my-robot"'
    timer = settings_of(timer_text(scheduled()))
    assert (timer["OnCalendar"], timer["Persistent"]) == ("*-*-* 02:30:00", "yes")


def test_metrics_are_written_after_each_run_whatever_came_of_it() -> None:
    run = replace(scheduled(), metrics=Path("/metrics/a b.prom"))
    found = settings_of(service_text(run, "robot", []))
    assert words_of(found["ExecStopPost"])[3:] == [
        "status", "/cells/my-robot/cell.toml", "--metrics", "/metrics/a b.prom",
    ]  # fmt: skip
    assert "ExecStopPost" not in service_text(scheduled(), "robot", [])


def test_a_cell_below_a_temporary_folder_is_seen_and_a_users_service_asks_nothing_of_root() -> None:
    for cell, private in (("/cells/a/c.toml", "yes"), ("/tmp/a/c.toml", "no"), ("/tmpa/c.toml", "yes")):
        assert settings_of(service_text(scheduled(cell), "robot", []))["PrivateTmp"] == private
    found = settings_of(service_text(scheduled(retries=0), None, ["dialout"]))
    assert not {"User", "ProtectSystem", "CapabilityBoundingSet", "Restart"} & set(found)


@given(PRINTABLE, PRINTABLE)
def test_any_path_is_one_argument(folder, file) -> None:
    run = scheduled(f"/{folder}/{file}")
    found = settings_of(service_text(run, "robot", []))
    assert words_of(found["ExecStart"]) == list(run.words)
    assert found["WorkingDirectory"].replace("%%", "%") == str(run.cell.parent)
    for text in (service_text(run, None, []), timer_text(run)):
        assert text.startswith(f"{MARK}{run.cell}\n")


def test_what_is_no_time_of_day_is_refused() -> None:
    for text in ("24:00", "2:30", "02:60", "", "02:30:00", "-1:00", "02.30"):
        with pytest.raises(UsageError, match="no time of day"):
            time_of_day(text)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="this computer has no systemd")
@pytest.mark.parametrize("user", [None, "root"])
def test_systemd_finds_nothing_wrong_with_them(tmp_path, user) -> None:
    run = scheduled(str(tmp_path / "a cell$ with %i" / "cell.toml"))
    run.cell.parent.mkdir()
    units = {"service": service_text(run, user, []), "timer": timer_text(run)}
    for kind, text in units.items():
        (tmp_path / f"{run.unit}.{kind}").write_text(text)
    files = [str(tmp_path / f"{run.unit}.{kind}") for kind in units]
    done = subprocess.run(
        ["systemd-analyze", "verify", *files], capture_output=True, text=True, check=False
    )
    assert [line for line in done.stderr.splitlines() if run.unit in line] == []


MONDAY = datetime(2026, 3, 2, tzinfo=UTC)


def at(clock: str, day: int = 0) -> datetime:
    hours, minutes = map(int, clock.split(":"))
    return MONDAY + timedelta(days=day, hours=hours, minutes=minutes)


def quiet(*spans: str, **changes: object) -> UnattendedSettings:
    return UnattendedSettings.model_validate({"quiet_hours": spans, **changes})


def test_a_span_may_go_past_midnight_and_one_that_follows_at_once_goes_on() -> None:
    nights = quiet("22:00-06:00")
    assert quiet_until(nights, at("23:30")) == at("06:00", 1)
    assert quiet_until(nights, at("05:59")) == at("06:00")
    assert quiet_until(nights, at("06:00")) is None
    assert quiet_until(quiet("06:00-14:00", "14:00-22:00"), at("07:00")) == at("22:00")


def test_days_are_those_on_which_they_begin_and_without_quiet_hours_there_are_none() -> None:
    friday = quiet("22:00-06:00", quiet_days=("fri",))
    assert quiet_until(friday, at("23:00")) is None
    assert quiet_until(friday, at("23:00", 4)) == at("06:00", 5)
    assert quiet_until(friday, at("05:00", 5)) == at("06:00", 5)
    assert next_quiet(friday, at("12:00")) == at("22:00", 4)
    assert quiet_until(quiet(), MONDAY) is None
    assert next_quiet(quiet(), MONDAY) is None
    assert next_quiet(quiet("05:30-22:00", quiet_days=()), MONDAY) is None


@given(st.integers(0, 1439), st.integers(1, 1439), st.integers(0, 6 * 1440))
def test_they_end_at_their_end_and_begin_at_their_begin(begin, length, minute) -> None:
    end = (begin + length) % 1440
    stated = quiet(f"{begin // 60:02}:{begin % 60:02}-{end // 60:02}:{end % 60:02}")
    now = MONDAY + timedelta(minutes=minute)
    since = (minute - begin) % 1440
    assert (quiet_until(stated, now) is not None) == (since < length)
    following = next_quiet(stated, now)
    assert following is not None
    assert following - now == (timedelta(0) if since < length else timedelta(minutes=1440 - since))


def test_what_is_no_span_is_refused() -> None:
    for span in ("5:30-22:00", "05:30-24:00", "05:30", "05:30-05:30", "at night"):
        with pytest.raises(ValidationError, match="is no span of a day"):
            quiet(span)
