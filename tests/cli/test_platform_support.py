"""On systems that lack what it needs, a command says so in a line: Linux with that taken away."""

import subprocess
import sys

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


def test_without_posix_every_command_says_that_it_needs_it_but_for_help(tmp_path):
    for command in (["run", "cell.toml"], ["cell", "schema"]):
        ended = typed(LIKE_WINDOWS, tmp_path, *command)
        assert ended.returncode == 2
        assert ended.stderr.startswith(
            "hexacell: this system has no POSIX file locks, terminals and signals"
        )
        assert (ended.stderr.count("\n"), "`wsl --install`" in ended.stderr) == (1, True)
    for command in (["run", "--help"], ["completion", "bash"]):
        ended = typed(LIKE_WINDOWS, tmp_path, *command)
        assert (ended.returncode, ended.stderr) == (0, "")
    assert list(tmp_path.iterdir()) == []


def test_only_a_run_in_another_process_needs_a_socket_that_tells_its_peer(tmp_path):
    ended = typed(LIKE_MACOS, tmp_path, "tui", "cell.toml")
    assert ended.returncode == 2
    assert ended.stderr.startswith("hexacell: this system does not report as Linux does")
    assert ended.stderr.endswith("Use `hexacell run` at this terminal, or Linux\n")
    assert typed(LIKE_MACOS, tmp_path, "cell", "schema").returncode == 0
