"""A geometry in two files, as commands write and restore it; killed between the two by a real SIGKILL."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hexacell.cell.loader import Cell
from hexacell.config.layout import Contents, read_contents
from tests.cli.commands import surroundings
from tests.hexacell.services.proposed_runs import ProposedRun, propose_run
from tests.several_config_files import hexapod_cell

pytestmark = pytest.mark.usefixtures("records_agree")

KILLED_AFTER = """
import os, signal, sys
from pathlib import Path
real, left = os.replace, int(sys.argv[1])
def replace(source, target):
    global left
    real(source, target)
    if Path(target).suffix in {".hal", ".ini"}:
        left -= 1
        if not left:
            os.kill(os.getpid(), signal.SIGKILL)
os.replace = replace
sys.argv = ["hexacell", *sys.argv[2:]]
from hexacell.__main__ import main
if "apply" in sys.argv:  # of a run without records
    from unittest.mock import AsyncMock
    from hexacell.services.write_back import proposals
    proposals.require_as_recorded = AsyncMock()
sys.exit(main())
"""
"""The program, killed once it has replaced so many files of the config."""


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    folder = tmp_path / "cell"
    folder.mkdir()
    return hexapod_cell(folder)


@pytest.fixture
def run(cell: Cell) -> ProposedRun:
    return propose_run(cell)


def found(cell: Cell) -> Contents:
    return read_contents(cell.config_paths)


def kill_after(folder: Path, files: int, *arguments: object) -> None:
    command = [sys.executable, "-c", KILLED_AFTER, str(files), *map(str, arguments)]
    temporary = folder / f"temporary-{files}"
    ended = subprocess.run(
        command, cwd=folder, env=surroundings(temporary), capture_output=True, text=True, check=False
    )
    assert ended.returncode == -signal.SIGKILL, ended.stderr


def test_both_are_applied_and_undone_and_shown_by_their_names(cell, run, typed_here) -> None:
    before, after = run.change.before_contents, run.change.after_contents
    applied = typed_here("apply", run.folder.path)
    assert (applied.code, found(cell)) == (0, after)
    hal, ini = cell.config_paths
    assert f"Written into {hal} and {ini}, approved by the command." in applied.out
    assert str(run.folder.path / "config-before-2") in applied.out
    again = typed_here("apply", run.folder.path)
    assert (again.code, "nothing was written" in again.out) == (0, True)
    undone = typed_here("rollback", cell.path)
    assert (undone.code, found(cell)) == (0, before)
    for name in ("hexapod.hal", "hexapod.ini"):
        assert f"--- {name}\n+++ {name}\n" in undone.out
    assert f"{ini} is {run.folder.path / 'config-before-2'} again, bit for bit" in undone.out
    restored = typed_here("rollback", cell.path, "--to", run.folder.path.name, "--json")
    assert (restored.code, found(cell)) == (0, after)
    assert restored.document["further_configs"] == [str(ini)]


def test_the_cell_is_checked_with_all_its_files(cell, typed_here) -> None:
    valid = typed_here("cell", "validate", cell.path)
    assert valid.code == 0
    assert "hexapod.hal and " in valid.out
    assert "hexapod.ini" in valid.out


def test_a_kill_between_the_two_is_undone_by_the_next_command(cell, run, typed_here, tmp_path) -> None:
    before = run.change.before_contents
    kill_after(tmp_path, 1, "apply", run.folder.path)
    assert found(cell) == (run.change.after_contents[0], before[1])
    told = typed_here("rollback", cell.path)
    assert "a write of hexapod.hal and hexapod.ini was interrupted between them" in told.err
    assert "hexapod.hal got the old content back" in told.err
    assert found(cell) == before
    assert "interrupted" not in typed_here("status", cell.path).err
