"""Units of systemd: what they start is what was meant, whatever signs are in a path."""

import shlex
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.errors import UsageError
from hexacell.services.unattended.scheduled_run import (
    ScheduledRun,
    cell_of,
    service_text,
    time_of_day,
    timer_text,
)

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


def test_a_cell_below_a_temporary_folder_is_not_hidden_from_its_run() -> None:
    for cell, private in (("/cells/a/c.toml", "yes"), ("/tmp/a/c.toml", "no"), ("/tmpa/c.toml", "yes")):
        assert settings_of(service_text(scheduled(cell), "robot", []))["PrivateTmp"] == private


def test_the_service_of_a_user_asks_for_nothing_that_only_root_may() -> None:
    found = settings_of(service_text(scheduled(retries=0), None, ["dialout"]))
    assert not {"User", "ProtectSystem", "CapabilityBoundingSet", "Restart"} & set(found)


@given(PRINTABLE, PRINTABLE)
def test_any_path_is_one_argument(folder, file) -> None:
    run = scheduled(f"/{folder}/{file}")
    found = settings_of(service_text(run, "robot", []))
    assert words_of(found["ExecStart"]) == list(run.words)
    assert found["WorkingDirectory"].replace("%%", "%") == str(run.cell.parent)
    assert cell_of(service_text(run, None, [])) == cell_of(timer_text(run)) == run.cell


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
