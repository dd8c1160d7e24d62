"""Runs that a scheduler starts: refused nights are explained, tried again, and ended in time."""

import re
import signal
from unittest.mock import Mock

import pytest

from hexacell.cli.commands.unattended import begun_in_window
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import RunRequest
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.journal.journal import EvidenceLost

pytestmark = pytest.mark.usefixtures("few_candidates")

ALWAYS = 'quiet_hours = ["00:00-12:00", "12:00-00:00"]'


def stated(cell_folder, text: str) -> None:
    cell_folder.cell.write_text(f"{cell_folder.cell.read_text()}\n[unattended]\n{text}\n")


def test_in_quiet_hours_no_run_begins_and_the_history_says_why(typed_here, short_cell) -> None:
    stated(short_cell, ALWAYS)
    before = short_cell.controller.read_bytes()
    outcome = typed_here("run", short_cell.cell, "--unattended")
    assert outcome.code == ExitCode.OUT_OF_TIME
    assert "these are quiet hours of the cell, until" in outcome.err
    [night] = typed_here("history", short_cell.cell, "--json").document["runs"]
    assert (night["mode"], night["begun"], night["over"], night["verdict"]) == ("check", False, True, None)
    assert "quiet hours" in night["line"]
    assert "not begun" in typed_here("history", short_cell.cell).out
    status = typed_here("status", short_cell.cell, "--json").document["cells"][0]
    assert "quiet hours" in status["not_begun"]
    assert "not begun: these are quiet hours" in " ".join(typed_here("status", short_cell.cell).out.split())
    assert short_cell.controller.read_bytes() == before


def test_a_night_on_which_the_cell_file_is_broken_is_explained(typed_here, short_cell) -> None:
    """A person who runs a broken file sees why, and leaves no note."""
    sound = short_cell.cell.read_text()
    short_cell.cell.write_text(f"{sound}\n[[[")
    assert typed_here("run", short_cell.cell).code == ExitCode.USAGE
    assert not (short_cell.path / "runs").exists()
    short_cell.cell.write_text(sound)
    stated(short_cell, ALWAYS)
    typed_here("run", short_cell.cell, "--unattended")
    sound = short_cell.cell.read_text()
    for pattern, mistake, reason in (
        (r"position_mm = [\d.]+", 'position_mm = "wide"', "position_mm"),
        (r'name = "simulated-hexaglide"', "name = simulated-hexaglide", "not valid TOML"),
    ):
        broken, places = re.subn(pattern, mistake, sound)
        assert places == 1
        short_cell.cell.write_text(broken)
        assert typed_here("run", short_cell.cell, "--unattended").code == ExitCode.USAGE
        short_cell.cell.write_text(sound)
        night, *_ = typed_here("history", short_cell.cell, "--json").document["runs"]
        assert (night["mode"], night["begun"], night["over"]) == ("check", False, True)
        assert reason in night["line"]
    assert "not begun" in typed_here("status", short_cell.cell).out


def test_a_person_at_the_machine_may_run_it_in_quiet_hours(typed_here, short_cell) -> None:
    """The hours are those of ``--unattended``."""
    stated(short_cell, ALWAYS)
    outcome = typed_here("run", short_cell.cell, "--mode", "quick")
    assert outcome.code == ExitCode.USAGE
    assert "no accepted result" in outcome.err
    assert typed_here("history", short_cell.cell, "--json").document["runs"] == []


@pytest.mark.slow
def test_a_run_whose_journal_is_gone_had_begun_and_is_not_begun_again(cell, tmp_path) -> None:
    folder = RunFolder(tmp_path / "run")
    request = RunRequest(cell, folder, Mode.CHECK, UnattendedOperator(), keeps_hours=True)
    begin = Mock(side_effect=EvidenceLost("the journal of this run is gone", action="Put it back"))
    with pytest.raises(EvidenceLost):
        begun_in_window(request, Console(), begin)
    begin.assert_called_once_with()
    assert not folder.path.exists()


def test_a_signal_ends_the_waiting(start, short_cell) -> None:
    stated(short_cell, f"{ALWAYS}\nwindow_minutes = 600\nretry_minutes = 60")
    process = start("run", short_cell.cell, "--unattended")
    process.wait_for("tried again in", lambda: process.err)
    assert process.stopped(signal.SIGTERM).code == ExitCode.INTERRUPTED
