"""``hexacell-restart-linuxcnc``: ends the LinuxCNC of this machine and starts it with its present files.

    hexacell-restart-linuxcnc hexapod.ini

is the ``reload_command`` of a cell whose geometry LinuxCNC reads at its start only, as ``HOME_OFFSET``.
It asks linuxcncrsh, whose port and passwords are in ``[DISPLAY] DISPLAY`` of the INI file, to shut LinuxCNC
down; starts it in the folder of the INI file, where ``linuxcnc.log`` gets what it prints; and returns when
linuxcncrsh answers. A LinuxCNC that a service starts is restarted by that service's own command.

LinuxCNC runs as long as its display. Where that is a screen, and linuxcncrsh one of the ``[APPLICATIONS]``
beside it, the screen is therefore ended: AXIS as LinuxCNC itself does it, any other by SIGTERM, after which
LinuxCNC may show a window with its messages. It needs a ``DISPLAY`` to come back on.
"""

import argparse
import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import count, takewhile
from pathlib import Path
from typing import Self

from hexacell.errors import HexacellError, UsageError
from hexacell.printable import printable
from hexacell.storage.atomic_files import read_end, require_no_link

LOCK = Path("/tmp/linuxcnc.lock")  # noqa: S108 - LinuxCNC's own, there from its start to its end
LOG = "linuxcnc.log"
ENDED_S, STARTED_S, ANSWER_S, POLL_S = 30.0, 60.0, 2.0, 0.1
SHOWN_CHARACTERS = 400
SERVER, AXIS = "linuxcncrsh", "axis"


@dataclass(frozen=True)
class _Configured:
    """What an INI file starts: linuxcncrsh with its port and passwords, and a screen if there is one."""

    ini: Path
    server: argparse.Namespace
    screen: str | None = None

    @classmethod
    def by(cls, ini: Path) -> Self:
        """What is started by an INI file, with linuxcncrsh's own defaults.

        Raises:
            UsageError: it does not start linuxcncrsh, or a screen that cannot come back.
        """
        parser = argparse.ArgumentParser(add_help=False)
        parser.add_argument("-p", "--port", type=int, default=5007)
        parser.add_argument("-w", "--connectpw", default="EMC")
        parser.add_argument("-e", "--enablepw", default="EMCTOO")
        program, *options = shlex.split(_variable(ini, "DISPLAY", "DISPLAY")) or [""]
        display = Path(program).name
        if display == SERVER:
            return cls(ini, parser.parse_known_args(options)[0])
        applications = (shlex.split(_variable(ini, "APPLICATIONS", "APP", number)) for number in count(1))
        for program, *options in takewhile(bool, applications):
            if Path(program).name == SERVER:
                if not os.environ.get("DISPLAY"):
                    raise UsageError(
                        f"{display} needs a screen, and there is no DISPLAY here",
                        action="Start hexacell on that screen, or restart LinuxCNC by your own command",
                    )
                return cls(ini, parser.parse_known_args(options)[0], display)
        raise UsageError(
            f"neither [DISPLAY] DISPLAY nor an [APPLICATIONS] APP of {ini} is {SERVER}",
            action="Name the INI file that LinuxCNC runs, or restart it by a command of your own",
        )

    def greets(self) -> bool:
        """Whether linuxcncrsh answers."""
        try:
            with self._connected() as connection:
                return bool(connection.recv(64))
        except OSError:
            return False

    def is_shut_down(self) -> bool:
        """Whether it has ended; if not, it is asked to, perhaps again: another client may garble that."""
        if screens := self._screens():
            if self.screen == AXIS:
                with suppress(subprocess.TimeoutExpired):
                    subprocess.run(["axis-remote", "--quit"], timeout=ANSWER_S, check=False)  # noqa: S607
                return False
            for process in screens:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGTERM)
            return False
        if not self.greets():
            return not LOCK.exists()
        with suppress(OSError), self._connected() as connection:
            connection.sendall(f"set enable {self.server.enablepw}\r\nshutdown\r\n".encode())
            while connection.recv(64):
                pass  # until it closes the connection
        return False

    def _connected(self) -> socket.socket:
        connection = socket.create_connection(("127.0.0.1", self.server.port), timeout=ANSWER_S)
        connection.sendall(f"hello {self.server.connectpw} restart 1.0\r\n".encode())
        return connection

    def _screens(self) -> list[int]:
        """The processes of the screen, which LinuxCNC gives the name of its INI file, or of a copy."""
        found: list[int] = []
        inis = {str(self.ini), f"{self.ini}.expanded"}
        for path in Path("/proc").glob("[0-9]*/cmdline") if self.screen else ():
            with suppress(OSError):  # it has ended meanwhile
                words = path.read_bytes().decode(errors="replace").split("\0")
                if self.screen in {Path(word).name for word in words[:2]} and inis & {*words}:
                    found.append(int(path.parent.name))
        return found


def _variable(ini: Path, section: str, name: str, number: int = 1) -> str:
    """The value of a variable, as LinuxCNC finds it; of one that is there often that with this number."""
    return subprocess.run(  # noqa: S603 - LinuxCNC's own program
        ["inivar", "-ini", str(ini), "-sec", section, "-var", name, "-num", str(number)],  # noqa: S607
        capture_output=True,
        text=True,
        check=False,
    ).stdout


def main() -> int:
    """Run the command; the exit status is 0, or 1 with one line that says why."""
    try:
        if len(sys.argv) != 2:
            raise UsageError("no INI file is named", action="hexacell-restart-linuxcnc FILE.ini")
        restart(Path(sys.argv[1]).absolute())
    except (HexacellError, OSError) as error:
        print(printable(f"hexacell-restart-linuxcnc: {error}"), file=sys.stderr)  # noqa: T201 - a command of its own
        return 1
    return 0


def restart(ini: Path, ended_s: float = ENDED_S, poll_s: float = POLL_S) -> subprocess.Popen[bytes]:
    """End LinuxCNC, if it runs, and start it with an INI file; the process that it is then.

    Raises:
        UsageError: it does not start linuxcncrsh, or a screen that cannot come back; it does not end, or it
            does not start.
        OSError: LinuxCNC is not installed here, or its folder cannot be written.
    """
    configured = _Configured.by(ini)
    _wait(configured.is_shut_down, ended_s, poll_s, "LinuxCNC does not end")
    log = ini.with_name(LOG)
    require_no_link(log)
    with log.open("wb") as output:
        started = subprocess.Popen(  # noqa: S603 - LinuxCNC's own program
            ["linuxcnc", "-r", ini.name],  # noqa: S607 - wherever it is installed
            cwd=ini.parent,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    answer = "LinuxCNC does not answer"
    _wait(lambda: configured.greets() or started.poll() is not None, STARTED_S, poll_s, answer)
    if started.poll() is not None:
        with log.open("rb") as output:
            said = read_end(output, SHOWN_CHARACTERS)
        raise UsageError(f"LinuxCNC ended at once: {said}", action=f"Look at {log}")
    return started


def _wait(condition: Callable[[], bool], limit_s: float, poll_s: float, problem: str) -> None:
    deadline = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > deadline:
            raise UsageError(f"{problem} within {limit_s:g} s", action="Look at it; the machine is off")
        time.sleep(poll_s)
