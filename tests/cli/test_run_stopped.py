"""A run that ends early says what is left and unverified, and is resumed with the command it printed."""

import os
import shlex
import shutil
import signal
import subprocess
import sys
import time

import pytest

from hexacell.cell.loader import load_cell
from hexacell.cli.commands.run import execute_run
from hexacell.cli.console import Console
from hexacell.errors import CellBusy
from hexacell.runs.cell_lock import cell_lock
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import RunRequest
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.journal.journal import read_entries, read_journal
from procedures.steps import events
from procedures.steps.roll_back import RollBack
from tests.recorded_events import record
from tests.signals import terminal_signals

STEPS_TO_STOP = 2  # that begin at most after a signal: it ends a run of dozens between two steps


@pytest.fixture
def good_cell(quick_cell, demo):
    """A quick cell that was calibrated before: checking it passes."""
    shutil.copy(demo.run / "config-after", quick_cell.controller)
    return quick_cell


def history(run):
    return read_journal(run / "journal.jsonl")


def under_way(process, cell, records: int) -> None:
    """Wait until so many records are taken."""
    process.wait_until(lambda: records_in(cell) >= records, f"{records} records")


def records_in(cell) -> int:
    journals = (cell.path / "runs").rglob("journal.jsonl")
    return sum(journal.read_text().count('"kind":"sampled"') for journal in journals)


def stopped_at_once(process, cell, number: signal.Signals):
    """How it ends on a signal, after which its runs hardly begin a step, by their own clock."""
    process.popen.send_signal(number)
    signalled_s = time.monotonic()
    outcome = process.ended()
    entries = [entry for run in cell.runs() for entry in read_entries(run / "journal.jsonl")]
    begun_s = [entry.monotonic_s for entry in entries if isinstance(entry.event, events.StepBegun)]
    assert sum(moment_s > signalled_s for moment_s in begun_s) <= STEPS_TO_STOP
    return outcome


def to_go_on(words: str) -> list[str]:
    """The command that a stopped run prints, without ``hexacell``."""
    lines = words.splitlines()
    place = lines.index("Stopped; what was measured is kept. To continue:")
    program, *arguments = shlex.split(lines[place + 1])
    assert program == "hexacell"
    return arguments


@pytest.mark.slow
def test_a_check_is_stopped_at_once_and_resumed_by_the_printed_command(start, typed_here, good_cell):
    config = good_cell.controller.read_bytes()
    process = start("run", good_cell.cell, "--unattended")
    under_way(process, good_cell, 1)
    outcome = stopped_at_once(process, good_cell, signal.SIGTERM)
    assert outcome.code == 130
    assert outcome.err == "hexacell: interrupted\n"
    [run] = good_cell.runs()
    last = history(run)[-1]
    assert isinstance(last, events.Interrupted)
    assert last.exit_code == 130
    arguments = to_go_on(outcome.out)
    assert arguments[:4] == ["run", str(good_cell.cell), "--resume", str(run)]
    resumed = typed_here(*arguments)
    assert resumed.code == 0, resumed.err
    assert resumed.out.splitlines()[-1].endswith(": pass")
    assert good_cell.runs() == [run]
    assert good_cell.controller.read_bytes() == config


def test_a_stop_before_anything_was_measured_leaves_nothing_to_resume(start, good_cell):
    process = start("run", good_cell.cell, "--json")
    process.wait_for("times as fast", lambda: process.err)
    outcome = stopped_at_once(process, good_cell, signal.SIGHUP)
    assert outcome.code == 130
    assert outcome.document == {"error": "interrupted", "exit_code": 130}
    assert ("To continue" in outcome.err) == bool(good_cell.runs())


@pytest.mark.slow
def test_a_closed_output_does_not_stop_the_run(start, good_cell):
    """``hexacell run ... | head -1``: the job is done, and the exit code is the job's."""
    reader, writer = os.pipe()
    os.close(reader)
    process = start("run", good_cell.cell, "--unattended", stdout=writer)
    os.close(writer)
    assert process.ended().code == 0
    assert isinstance(history(good_cell.runs()[0])[-1], events.Ended)


@pytest.mark.parametrize("arguments", [["cell", "schema"], ["--help"]], ids=" ".join)
def test_a_closed_pipe_causes_no_traceback(arguments, tmp_path):
    script = ["bash", "-c", 'set -o pipefail; "$@" | true', "bash"]
    with terminal_signals():
        shell = subprocess.run(
            [*script, sys.executable, "-m", "hexacell", *arguments],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            check=False,
        )
    assert (shell.returncode, shell.stderr) == (0, "")


LOST = """
[[simulation.faults]]
kind = "unplugged"
device = "controller"
at_move = 2
"""


def test_a_robot_that_could_not_be_stopped_is_the_first_thing_said(typed_here, good_cell):
    """What was measured, and how to go on, comes after it."""
    good_cell.cell.write_text(good_cell.cell.read_text() + LOST)
    outcome = typed_here("run", good_cell.cell, "--unattended", "--json")
    assert outcome.code == 3
    said = outcome.err
    assert said.index("PRESS THE EMERGENCY STOP. The robot could not be") < said.index("Stopped; what was")
    assert outcome.document["error"].startswith("PRESS THE EMERGENCY STOP")


COMMITTED = events.Committed(approved_by="a tester")
WITHDRAWN = [events.StepBegun(step=RollBack()), events.RolledBack()]
UNVERIFIED = "The controller's config holds the new geometry, which is not verified yet"


@pytest.mark.parametrize(("history", "is_said"), [([COMMITTED], True), ([COMMITTED, *WITHDRAWN], False)])
def test_an_unverified_geometry_is_always_reported(cell_folder, capsys, history, is_said: bool) -> None:
    """Also if resuming fails before the engine runs."""
    folder = RunFolder(cell_folder.path / "run")
    folder.path.mkdir()
    record(folder.journal, history)
    cell = load_cell(cell_folder.cell)
    order = RunRequest(cell, folder, Mode.OPTIMISE, UnattendedOperator(), unattended=True, resume=True)
    with cell_lock(cell.config_path), pytest.raises(CellBusy):
        execute_run(order, Console())
    assert (UNVERIFIED in capsys.readouterr().err) == is_said
