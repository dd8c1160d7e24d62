"""``hexacell tui`` without a terminal, and what it loads before it shows something."""

import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

from hexacell.cell.bundled import bundled_config
from tests.waiting import wait_until


def test_without_a_terminal_it_is_a_usage_error(typed_here) -> None:
    refused = typed_here("tui", bundled_config("simulated-hexaglide"))
    problem, action = "the screen needs a terminal", "Use `hexacell run`"
    assert refused.code == 2
    assert refused.err == f"hexacell: {problem}. {action}, which asks line by line\n"


def test_the_first_screen_needs_neither_numpy_nor_pydantic(tmp_path: Path) -> None:
    program = "import sys, hexacell.cli.commands.tui; print(*sys.modules)"
    imported = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    loaded = set(imported.stdout.split())
    assert "textual" in loaded
    assert loaded.isdisjoint({"numpy", "scipy", "pydantic", "can", "tomlkit"})


def test_a_dumb_terminal_is_a_usage_error(tmp_path: Path) -> None:
    program = "import os, pty; os._exit(os.waitstatus_to_exitcode(pty.spawn(__import__('sys').argv[1:])))"
    command = [sys.executable, "-m", "hexacell", "tui", str(bundled_config("simulated-hexaglide"))]
    ended = subprocess.run(
        [sys.executable, "-c", program, *command],
        cwd=tmp_path,
        env={**os.environ, "TERM": "dumb"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 2
    assert "this terminal cannot draw a screen (TERM is dumb). Use `hexacell run`" in ended.stdout


def test_it_ends_with_its_terminal_though_no_signal_says_so(tmp_path: Path) -> None:
    """As where a connection is lost below nohup, or another process had the terminal first."""
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "hexacell", "tui", "cell.toml"],
        cwd=tmp_path,
        env={**os.environ, "TERM": "xterm-256color"},
        stdin=slave,
        stdout=slave,
        stderr=slave,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN),  # noqa: PLW1509 - it is one call
    )
    os.close(slave)
    try:
        shown = b""
        while b"Question 1 of" not in shown:
            shown += os.read(master, 65536)
        os.close(master)
        wait_until(lambda: process.poll() is not None)
        assert process.returncode == 130
    finally:
        process.kill()
        process.wait()
