"""The real program in tmux, with a cell that another process serves: measured, left, come back to."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hexacell.cell.loader import load_cell
from hexacell.run_process.run_socket import socket_path
from tests.screen.served_cell import served_in
from tests.waiting import wait_until

TMUX = shutil.which("tmux")

pytestmark = [pytest.mark.slow, pytest.mark.skipif(TMUX is None, reason="tmux is not installed")]


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Path]:
    with served_in(tmp_path) as path:
        yield path


class Terminal:
    """A terminal of its own server, of 100 columns and 30 rows."""

    def __init__(self, folder: Path) -> None:
        self._socket = str(folder / "tmux")

    def run(self, *words: str) -> str:
        command = [str(TMUX), "-S", self._socket, *words]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout

    def open(self, *command: str) -> None:
        self.run("new-session", "-d", "-x", "100", "-y", "30", *command)

    def press(self, *keys: str) -> None:
        self.run("send-keys", *keys)

    def shows(self, text: str) -> bool:
        return text in self.run("capture-pane", "-p")

    def wait_for(self, text: str) -> None:
        wait_until(lambda: self.shows(text))

    def is_over(self) -> bool:
        return not self.run("list-sessions")

    def kill(self) -> None:
        self.run("kill-server")
        wait_until(self.is_over)


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    opened = Terminal(tmp_path)
    yield opened
    opened.kill()


def test_a_run_is_begun_left_and_stopped_at_the_screen(served: Path, terminal: Terminal) -> None:
    tui = (sys.executable, "-m", "hexacell", "tui", str(served))
    terminal.open(*tui)
    terminal.wait_for("um, 0.")  # a gauge shows something
    terminal.press("2")
    terminal.wait_for("What must hold before the robot moves")
    terminal.press("s")
    terminal.wait_for("1/2 ")  # the second record
    terminal.press("q")
    terminal.wait_for("A run goes on here")
    terminal.press("l")
    wait_until(terminal.is_over)

    terminal.open(*tui)
    terminal.wait_for("1/3 ")
    terminal.press("p")
    terminal.wait_for("PAUSED")
    terminal.press("q")
    terminal.wait_for("A run goes on here")
    terminal.press("s")
    wait_until(terminal.is_over)
    wait_until(lambda: not socket_path(load_cell(served)).exists())
