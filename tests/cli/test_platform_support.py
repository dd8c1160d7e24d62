"""On systems that lack what it needs, a command says so in a line: Linux with that taken away."""

from __future__ import annotations

import subprocess
import sys

import pytest

LIKE_WINDOWS = """
import os, signal, sys
for module in ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"):
    sys.modules[module] = None
for name in ("SIGHUP", "SIGKILL", "SIGUSR1", "SIGUSR2"):
    delattr(signal, name)
for name in ("fchmod", "fork", "getuid", "geteuid", "openpty", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK"):
    delattr(os, name)
"""
LIKE_MACOS = """
import socket
del socket.SO_PEERCRED
"""
COMMAND = """
from hexacell.cli.app import main
sys.exit(main(sys.argv[1:]))
"""


def typed(system: str, folder, *arguments: str) -> subprocess.CompletedProcess[str]:
    code = f"import sys\n{system}{COMMAND}"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    "command", [["run", "cell.toml"], ["cell", "schema"], ["study", "paper"], ["demo"]]
)
def test_without_posix_every_command_says_that_it_needs_it(tmp_path, command):
    ended = typed(LIKE_WINDOWS, tmp_path, *command)
    assert ended.returncode == 2
    assert ended.stderr == (
        "hexacell: this system has no POSIX file locks, terminals and signals, by which hexacell protects "
        "a cell. Use Linux; on Windows install it there with `wsl --install`\n"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", [["--help"], ["run", "--help"], ["--version"], ["completion", "bash"]])
def test_without_posix_there_are_help_and_completion(tmp_path, command):
    ended = typed(LIKE_WINDOWS, tmp_path, *command)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_run_in_another_process_needs_a_socket_that_tells_its_peer(tmp_path):
    ended = typed(LIKE_MACOS, tmp_path, "tui", "cell.toml")
    assert ended.returncode == 2
    assert ended.stderr.startswith(
        "hexacell: this system does not report as Linux does who is at the other end"
    )
    assert ended.stderr.endswith("Use `hexacell run` at this terminal, or Linux\n")


def test_other_commands_do_without_it(tmp_path):
    assert typed(LIKE_MACOS, tmp_path, "cell", "schema").returncode == 0
