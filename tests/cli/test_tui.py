"""``hexacell tui`` without a terminal, and what it loads before it shows something."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from hexacell.cell.bundled import bundled_config


def test_without_a_terminal_it_is_a_usage_error(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hexacell", "tui", str(bundled_config("simulated-hexaglide"))]
    ended = subprocess.run(
        command, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    problem, action = "the screen needs a terminal, and this is none", "Use `hexacell run`"
    assert ended.stderr == f"hexacell: {problem}. {action}, which asks line by line\n"


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
