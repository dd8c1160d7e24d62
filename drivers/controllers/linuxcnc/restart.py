"""``hexacell-restart-linuxcnc``: ends the LinuxCNC of this machine and starts it with its present files.

    hexacell-restart-linuxcnc hexapod.ini

is the ``reload_command`` of a cell whose geometry LinuxCNC reads at its start only, as ``HOME_OFFSET``.
It asks linuxcncrsh, whose port and passwords are in ``[DISPLAY] DISPLAY`` of the INI file, to shut LinuxCNC
down; starts it in the folder of the INI file, where ``linuxcnc.log`` gets what it prints; and returns when
linuxcncrsh answers. A LinuxCNC that a service starts is restarted by that service's own command.
"""

from __future__ import annotations

import argparse
import shlex
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from hexacell.errors import HexacellError, UsageError

LOCK = Path("/tmp/linuxcnc.lock")  # noqa: S108 - LinuxCNC's own, there from its start to its end
LOG = "linuxcnc.log"
ENDED_S, STARTED_S, ANSWER_S, POLL_S = 30.0, 60.0, 2.0, 0.1
SHOWN_CHARACTERS = 400


def main() -> int:
    """Run the command; the exit status is 0, or 1 with one line that says why."""
    try:
        if len(sys.argv) != 2:
            raise UsageError("no INI file is named", action="hexacell-restart-linuxcnc FILE.ini")
        restart(Path(sys.argv[1]).absolute())
    except (HexacellError, OSError) as error:
        print(f"hexacell-restart-linuxcnc: {error}", file=sys.stderr)  # noqa: T201 - a command of its own
        return 1
    return 0


def restart(ini: Path) -> subprocess.Popen[bytes]:
    """End LinuxCNC, if it runs, and start it with an INI file; the process that it is then.

    Raises:
        UsageError: its display is not linuxcncrsh, it does not end, or it does not start.
        OSError: LinuxCNC is not installed here, or its folder cannot be written.
    """
    server = _server_of(ini)
    _wait(lambda: _is_shut_down(server), ENDED_S, "LinuxCNC does not end")
    log = ini.with_name(LOG)
    with log.open("wb") as output:
        started = subprocess.Popen(  # noqa: S603 - LinuxCNC's own program
            ["linuxcnc", "-r", ini.name],  # noqa: S607 - wherever it is installed
            cwd=ini.parent,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    _wait(lambda: _greeting(server) or started.poll() is not None, STARTED_S, "LinuxCNC does not answer")
    if started.poll() is not None:
        said = log.read_text(errors="replace").strip()[-SHOWN_CHARACTERS:]
        raise UsageError(f"LinuxCNC ended at once: {said}", action=f"Look at {log}")
    return started


def _server_of(ini: Path) -> argparse.Namespace:
    """Port and passwords of linuxcncrsh, with its own defaults."""
    done = subprocess.run(  # noqa: S603 - LinuxCNC's own program
        ["inivar", "-ini", str(ini), "-sec", "DISPLAY", "-var", "DISPLAY"],  # noqa: S607
        capture_output=True,
        text=True,
        check=False,
    )
    program, *options = shlex.split(done.stdout) or [""]
    if Path(program).name != "linuxcncrsh":
        raise UsageError(
            f"[DISPLAY] DISPLAY of {ini} is not linuxcncrsh",
            action="Name the INI file that LinuxCNC runs, or restart it by a command of your own",
        )
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("-p", "--port", type=int, default=5007)
    parser.add_argument("-w", "--connectpw", default="EMC")
    parser.add_argument("-e", "--enablepw", default="EMCTOO")
    return parser.parse_known_args(options)[0]


def _greeting(server: argparse.Namespace) -> bool:
    """Whether it answers."""
    try:
        with _connected(server) as connection:
            return bool(connection.recv(64))
    except OSError:
        return False


def _connected(server: argparse.Namespace) -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", server.port), timeout=ANSWER_S)
    connection.sendall(f"hello {server.connectpw} restart 1.0\r\n".encode())
    return connection


def _is_shut_down(server: argparse.Namespace) -> bool:
    """Whether it has ended; if not, it is asked to, perhaps again: another client may garble that."""
    if not _greeting(server):
        return not LOCK.exists()
    with suppress(OSError), _connected(server) as connection:
        connection.sendall(f"set enable {server.enablepw}\r\nshutdown\r\n".encode())
        while connection.recv(64):
            pass  # until it closes the connection
    return False


def _wait(condition: Callable[[], bool], limit_s: float, problem: str) -> None:
    deadline = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > deadline:
            raise UsageError(f"{problem} within {limit_s:g} s", action="Look at it; the machine is off")
        time.sleep(POLL_S)


if __name__ == "__main__":
    sys.exit(main())
