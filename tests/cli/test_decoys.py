"""Protects that no process of hexacell imports what lies in the folder it is started in."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from hexacell.cell.loader import load_cell
from hexacell.python_process import python_command
from hexacell.services.unattended.schedules import scheduled_run
from tests.signals import terminal_signals

CHECKOUT = Path(__file__).parents[2]
DECOYS = ("can", "serial", "drivers", "procedures", "numpy", "pydantic", "asyncio", "argparse")
ALSO_OURS = ("hexacell", "runpy", "multiprocessing", "pickle")
"""Found before the first line of ours runs, unless the interpreter itself is told to leave them out."""


def put_decoys(folder, names):
    for name in names:
        (folder / f"{name}.py").write_text(f"raise SystemExit('{name} of the folder')\n")


def ended(command, folder):
    words = [str(word) for word in command]
    with terminal_signals():
        return subprocess.run(
            words, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
        )


@pytest.mark.parametrize("command", [(sys.executable, "-m", "hexacell"), python_command("hexacell")])
def test_a_command_in_a_folder_of_decoys_uses_none(cell_folder, command):
    folder = cell_folder.cell.parent
    put_decoys(folder, DECOYS + (ALSO_OURS if "-P" in command else ()))
    done = ended([*command, "cell", "validate", cell_folder.cell.name], folder)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_child_of_the_screen_uses_none(cell_folder):
    put_decoys(cell_folder.cell.parent, DECOYS + ALSO_OURS)
    command = python_command("hexacell.screen.child", "preflight", "absent.toml", "check")
    assert "absent.toml" in ended(command, cell_folder.cell.parent).stdout


def test_a_schedule_starts_it_so(cell_folder):
    run = scheduled_run(load_cell(cell_folder.cell), "02:30", "check", None)
    assert run.program == python_command("hexacell")


WORKERS = """
import os
from hexacell.study.tasks import processes
if __name__ == "__main__":
    with processes(1)() as workers:
        print(workers.submit(os.getpid).result() != os.getpid())
"""


def test_workers_of_a_study_use_none(tmp_path):
    folder, script = tmp_path / "cell", tmp_path / "script.py"
    folder.mkdir()
    put_decoys(folder, (*DECOYS, *ALSO_OURS))
    script.write_text(WORKERS)
    assert ended([sys.executable, script], folder).stdout == "True\n"


def test_no_other_place_starts_an_interpreter():
    found = {
        path.relative_to(CHECKOUT).as_posix()
        for package in ("hexacell", "drivers", "procedures")
        for path in (CHECKOUT / package).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "sys.executable"
    }
    # Beside the mechanism, only where programs installed with this one are looked for.
    assert found == {"hexacell/python_process.py", "drivers/controllers/reload_command.py"}
