"""What commands beside a run leave: signals, edits and limits at any call, file systems, a wrong clock."""

import errno
import os
import signal
import tempfile
from collections.abc import Callable
from datetime import datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from hexacell.cell.loader import Cell
from hexacell.cli import app
from hexacell.config import write_record
from hexacell.runs import run_folder
from hexacell.services.history import cell_status
from procedures.journal import journal
from tests.faults.interception import Call, intercepted
from tests.hexacell.services.proposed_runs import ProposedRun, a_cell, propose_run
from tests.signals import terminal_signals

pytestmark = pytest.mark.usefixtures("records_agree")

EDIT = b"# edited by a person\n"


def calls(name: str, last: int, step: int) -> list[Any]:
    """A command and the numbers of its calls; of these every fourth is in the sample."""
    numbers = range(1, last, step)
    return [
        pytest.param(name, at, marks=pytest.mark.slow if nth % 4 else ()) for nth, at in enumerate(numbers)
    ]


WRITING = calls("apply", 45, 4) + calls("rollback", 19, 3)
AT_CALLS = pytest.mark.parametrize(
    ("name", "at"), WRITING + calls("report", 7, 2) + calls("schedule", 14, 3)
)


class WrongClock(datetime):
    by = timedelta()

    @classmethod
    def now(cls, tz: Any = None) -> Any:
        return datetime.now(tz) + cls.by


class Commands:
    """A cell with a proposal, and commands that are typed there."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.cell: Cell = a_cell(folder)
        self.run: ProposedRun = propose_run(self.cell)
        self.folder, self._capsys = folder, capsys

    def type(self, *words: object) -> tuple[int, str]:
        with terminal_signals():
            code = app.main([str(word) for word in words])
        said = self._capsys.readouterr()
        return code, said.out + said.err

    def words(self, name: str) -> list[object]:
        units = ["--daily", "03:30", "--folder", self.folder] if name == "schedule" else []
        return [name, self.run.folder.path if name in {"apply", "report"} else self.cell.path, *units]

    def with_hook(self, name: str, at: int, act: Callable[[], Exception | None]) -> tuple[int, str]:
        """Type a command that has something happen at its how manieth call that changes a file."""
        if name == "rollback":
            assert self.type(*self.words("apply"))[0] == 0
        numbers = count(1)

        def hook(_: Call) -> Exception | None:
            return act() if next(numbers) == at else None

        with intercepted(self.folder, hook):
            return self.type(*self.words(name))

    @property
    def config(self) -> bytes:
        return self.cell.config_path.read_bytes()


@pytest.fixture
def commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Commands:
    return Commands(tmp_path, capsys)


@AT_CALLS
def test_a_signal_at_any_call_leaves_what_is_said(commands, name, at) -> None:
    """A write of the config that has begun is finished; all else is interrupted and can be repeated."""
    code, said = commands.with_hook(name, at, lambda: os.kill(os.getpid(), signal.SIGTERM))
    wanted = commands.run.after if name == "apply" else commands.run.before
    assert (code, commands.config) == (0 if name in {"apply", "rollback"} else 130, wanted), said
    assert [*commands.folder.rglob(".hexacell-*")] == []
    if code:
        assert commands.type(*commands.words(name))[0] == 0


@pytest.mark.parametrize(("name", "at"), WRITING)
def test_an_edit_while_a_command_is_stopped_is_kept(commands, name, at) -> None:
    def edit() -> None:
        commands.cell.config_path.write_bytes(commands.config + EDIT)

    code, said = commands.with_hook(name, at, edit)
    kept = [path.read_bytes() for path in commands.run.folder.path.glob("config-found-*")]
    assert any(one.endswith(EDIT) for one in (commands.config, *kept)), said
    assert code in {0, 2, 6}


@pytest.mark.parametrize("number", [errno.EFBIG, errno.EDQUOT, errno.ENOSPC])
@AT_CALLS
def test_a_limit_reached_at_any_call_is_told_and_the_config_is_whole(commands, name, at, number) -> None:
    assert commands.with_hook(name, at, lambda: OSError(number, os.strerror(number)))[0] in {0, 2, 6}
    assert commands.config in {commands.run.before, commands.run.after}


def test_ctrl_c_before_the_arguments_are_known_is_told_in_words(commands, monkeypatch) -> None:
    monkeypatch.setattr(app, "make_parser", lambda: os.kill(os.getpid(), signal.SIGINT))
    assert commands.type("status") == (130, "hexacell: interrupted\n")


def test_a_config_on_another_file_system_is_written_and_rolled_back(commands) -> None:
    path = commands.cell.config_path
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as place:
        target = path.rename(commands.folder / "moved")
        (elsewhere := Path(place) / "config").write_bytes(target.read_bytes())
        path.symlink_to(elsewhere)
        for name, wanted in (("apply", commands.run.after), ("rollback", commands.run.before)):
            assert commands.type(*commands.words(name))[0] == 0
            assert (path.is_symlink(), elsewhere.read_bytes()) == (True, wanted)


def test_a_clock_that_was_set_back_and_forward_undoes_the_latest_write(commands, monkeypatch) -> None:
    assert commands.type(*commands.words("apply"))[0] == 0
    for module in (journal, run_folder, write_record, cell_status):
        monkeypatch.setattr(module, "datetime", WrongClock)
    WrongClock.by = timedelta(days=-3000)
    second = propose_run(commands.cell, "2026-11-21T100000Z", shift_mm=0.5)
    assert commands.type("apply", second.folder.path)[0] == 0
    assert commands.type("report", second.folder.path)[0] == 0
    WrongClock.by = timedelta(days=3000)
    for wanted in (second.before, commands.run.before):
        assert commands.type(*commands.words("rollback"))[0] == 0
        assert commands.config == wanted
