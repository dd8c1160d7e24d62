"""A simulated serial line on a pseudo-terminal."""

from __future__ import annotations

import fcntl
import os
import re
import struct
import termios
import tty
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from drivers.simulated.transports.interface import CHUNK, write_or_drop

NOT_IN_FILE_NAMES = re.compile(r"[^\w.-]+")


class PtyTransport:
    """A pseudo-terminal behind a symbolic link of constant name, like those in ``/dev/serial/by-id``."""

    connections = 0

    def __init__(self, name: str) -> None:
        self._folder = TemporaryDirectory(prefix="hexacell-")
        self._link = Path(self._folder.name) / NOT_IN_FILE_NAMES.sub("-", name)
        self._master = self._slave = -1
        self.plug_in()

    @property
    def url(self) -> str:
        """The path of the link."""
        return str(self._link)

    def plug_in(self) -> None:
        """Create a pseudo-terminal in raw mode and link to it."""
        if self._master >= 0:
            return
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self._reset_speed()
        os.set_blocking(self._master, False)
        # packet mode: a read also reports that a client has configured the terminal
        fcntl.ioctl(self._master, termios.TIOCPKT, struct.pack("i", 1))
        self._link.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """Remove the link and close both ends."""
        if self._master < 0:
            return
        self._link.unlink()
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    def descriptors(self) -> list[int]:
        """The master end."""
        return [] if self._master < 0 else [self._master]

    def receive(self, ready: Sequence[int]) -> bytes:
        """One packet: data, or the notice of a change at the client's end."""
        if self._master not in ready:
            return b""
        packet = os.read(self._master, CHUNK)
        if packet[:1] != b"\0":
            self._reset_speed()
        return packet[1:] if packet[:1] == b"\0" else b""

    def send(self, data: bytes, wait_s: float = 0.0) -> None:
        """Write to the master end."""
        if self._master >= 0:
            write_or_drop(self._master, data, wait_s)

    def close(self) -> None:
        """Close both ends and remove the link."""
        self.unplug()
        self._folder.cleanup()

    def _reset_speed(self) -> None:
        """Set a default speed, so that the next client has a setting to change.

        A pseudo-terminal ignores parity, and ``tcsetattr`` fails if nothing at all changed; so a port
        with parity could be opened only once (pyserial issue 196).
        """
        attributes = termios.tcgetattr(self._slave)
        attributes[4] = attributes[5] = termios.B38400
        termios.tcsetattr(self._slave, termios.TCSANOW, attributes)
