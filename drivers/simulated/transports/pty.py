"""A line that is a pseudo-terminal."""

from __future__ import annotations

import fcntl
import os
import re
import struct
import termios
import tty
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from drivers.simulated.transports.interface import CHUNK

UNFIT = re.compile(r"[^\w.-]+")  # for a file name


class PtyTransport:
    """A pseudo-terminal behind a link whose name stays, like those in ``/dev/serial/by-id``."""

    def __init__(self, name: str) -> None:
        self._folder = TemporaryDirectory(prefix="hexacell-")
        self._link = Path(self._folder.name) / UNFIT.sub("-", name)
        self._near = self._far = -1
        self.plug_in()

    @property
    def url(self) -> str:
        """The link's path."""
        return str(self._link)

    def plug_in(self) -> None:
        """Make a pseudo-terminal in raw mode and link to it."""
        if self._near >= 0:
            return
        self._near, self._far = os.openpty()
        tty.setraw(self._far)
        self._reset_speed()
        os.set_blocking(self._near, False)
        # packet mode: a read also tells that somebody has opened and configured the far end
        fcntl.ioctl(self._near, termios.TIOCPKT, struct.pack("i", 1))
        self._link.symlink_to(os.ttyname(self._far))

    def unplug(self) -> None:
        """Take the link and both ends away."""
        if self._near < 0:
            return
        self._link.unlink()
        os.close(self._near)
        os.close(self._far)
        self._near = self._far = -1

    def descriptors(self) -> list[int]:
        """The near end."""
        return [] if self._near < 0 else [self._near]

    def receive(self, ready: Sequence[int]) -> bytes:
        """One packet: bytes, or the news of a change at the far end."""
        if self._near not in ready:
            return b""
        packet = os.read(self._near, CHUNK)
        if packet[:1] != b"\0":
            self._reset_speed()
        return packet[1:] if packet[:1] == b"\0" else b""

    def send(self, data: bytes) -> None:
        """Write to the near end as far as there is room."""
        if self._near >= 0:
            with suppress(BlockingIOError):
                os.write(self._near, data)

    def close(self) -> None:
        """Close both ends and remove the link."""
        self.unplug()
        self._folder.cleanup()

    def _reset_speed(self) -> None:
        """Give the next one to open the far end something that it can change.

        A pseudo-terminal ignores parity, and ``tcsetattr`` fails if nothing at all changed; so a port
        with parity could be opened only once (pyserial issue 196).
        """
        attributes = termios.tcgetattr(self._far)
        attributes[4] = attributes[5] = termios.B38400
        termios.tcsetattr(self._far, termios.TCSANOW, attributes)
