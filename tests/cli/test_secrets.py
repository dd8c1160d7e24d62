"""Passwords reach no file of a run and no screen; files of runs belong to their user."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.cell_folder import ASK

CLEAR = ("[controller]\n", '[controller]\nconnect_password = "hunter2"\nenable_password = "hunter3"\n')


@pytest.fixture
def open_umask() -> Iterator[None]:
    """Every file that is made is writable by everybody unless the program sees to it."""
    old = os.umask(0)
    yield
    os.umask(old)


def files_below(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_a_run_keeps_no_password_can_be_resumed_and_its_files_are_its_users(
    typed_here, quick_cell, demo, few_candidates, open_umask
):
    quick_cell.edit(CLEAR, ASK)
    own = {quick_cell.cell, quick_cell.controller}
    outcome = typed_here("run", quick_cell.cell, "--mode", "check", "--unattended")
    assert outcome.code in {0, 1}, outcome.err
    assert "a password stands here in clear" in outcome.err
    [run] = quick_cell.runs()
    made = [path for path in [*files_below(quick_cell.path), run, run.parent] if path not in own]
    assert len(made) > 4
    assert [path for path in made if path.stat().st_mode & stat.S_IWOTH] == []
    assert [path for path in files_below(run) if b"hunter" in path.read_bytes()] == []
    assert "hunter" not in outcome.out + outcome.err

    rewound = quick_cell.rewound(demo.run, "propose", (run / "cell.toml").read_text())
    quick_cell.edit(("hunter2", "changed"))
    resumed = typed_here(
        "run", quick_cell.cell, "--mode", "optimise", "--unattended", "--resume", rewound.name
    )
    assert (resumed.code, "the new geometry waits for approval" in resumed.err) == (4, True)


def test_show_and_validate_warn_and_show_no_password(typed_here, cell_folder):
    cell_folder.edit(CLEAR)
    for command in (["show"], ["show", "--json"], ["validate"]):
        outcome = typed_here("cell", *command, cell_folder.cell)
        assert outcome.code == 0
        assert outcome.err.startswith(f"hexacell: warning: {cell_folder.cell}:")
        assert "hunter" not in outcome.out + outcome.err


def test_export_is_told_and_refuses_to_write_over_something(typed_here, demo, tmp_path):
    outcome = typed_here("replay", demo.run, "--export", tmp_path / "copy", "--json")
    assert outcome.code == 0
    assert "journal.jsonl" in outcome.document["files"]
    assert "every password masked" in outcome.err
    outcome = typed_here("replay", demo.run, "--export", tmp_path / "copy")
    assert outcome.code == 2
    assert "something is there already" in outcome.err


def real(cell_folder, host: str) -> None:
    """The same cell with devices that are not simulated."""
    cell_folder.without_simulation('{ interface = "virtual", token = "hunter2" }')
    cell_folder.edit(("[controller]", f'[controller]\nport = 5007\nhost = "{host}"'))


def test_a_controller_across_the_network_is_warned_of(typed_here, cell_folder):
    real(cell_folder, "192.168.1.7")
    outcome = typed_here("cell", "validate", cell_folder.cell)
    assert outcome.code == 0
    assert "warning: controller 192.168.1.7:5007: passwords and commands go there" in outcome.err
    shown = typed_here("cell", "show", cell_folder.cell).out
    assert 'token = "***"' in shown
    assert "hunter" not in shown


def test_a_local_controller_that_the_network_can_reach_is_warned_of(typed_here, cell_folder, monkeypatch):
    real(cell_folder, "127.0.0.1")
    for is_open in (True, False):
        monkeypatch.setattr(
            "hexacell.services.preflight.accepts_from_network",
            lambda port, is_open=is_open: is_open and port == 5007,
        )
        outcome = typed_here("cell", "validate", cell_folder.cell)
        assert outcome.code == 0
        assert ("it accepts connections from the network too" in outcome.err) is is_open
