"""The device's end of a simulated serial line: a pseudo-terminal, or a TCP port of this machine.

One thread receives, what comes on the descriptors that are ready, possibly nothing; ``send`` may be
called from another one, and what a full buffer does not take in time is lost, as on a cable. ``url`` is
what ``serial.serial_for_url`` opens, the same after unplugging and plugging in again. ``connections`` is
how many clients have connected; 0 where a connection cannot be noticed. ``openings`` is how often a client
has opened it, at another speed than 38400 baud where it is a pseudo-terminal.
"""

import fcntl
import os
import re
import select
import socket
import struct
import termios
import tty
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

CHUNK = 1024
LOOPBACK = "127.0.0.1"
NOT_IN_FILE_NAMES = re.compile(r"[^\w.-]+")


class PtyLine:
    """A pseudo-terminal behind a symbolic link of constant name, like those in ``/dev/serial/by-id``."""

    connections = 0

    def __init__(self, name: str) -> None:
        self._folder = TemporaryDirectory(prefix="hexacell-")
        self._link = Path(self._folder.name) / NOT_IN_FILE_NAMES.sub("-", name)
        self._master = self._slave = -1
        self.openings = 0
        self.plug_in()

    @property
    def url(self) -> str:
        return str(self._link)

    def plug_in(self) -> None:
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
        if self._master < 0:
            return
        self._link.unlink()
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    def descriptors(self) -> list[int]:
        return [] if self._master < 0 else [self._master]

    def receive(self, ready: Sequence[int]) -> bytes:
        if self._master not in ready:
            return b""
        packet = os.read(self._master, CHUNK)
        if packet[:1] != b"\0":
            self.openings += termios.tcgetattr(self._slave)[4] != termios.B38400
            self._reset_speed()
        return packet[1:] if packet[:1] == b"\0" else b""

    def send(self, data: bytes, wait_s: float = 0.0) -> None:
        if self._master >= 0:
            _write_or_drop(self._master, data, wait_s)

    def close(self) -> None:
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


class SocketLine:
    """A TCP port that serves one client at a time."""

    def __init__(self) -> None:
        self._port = 0
        self._listener = self._bound()
        self._port = self._listener.getsockname()[1]
        self._client: socket.socket | None = None
        self._plugged = False
        self.connections = 0
        self.plug_in()

    @property
    def openings(self) -> int:
        return self.connections

    @property
    def url(self) -> str:
        return f"socket://{LOOPBACK}:{self._port}"

    def plug_in(self) -> None:
        self._listener.listen(1)
        self._plugged = True

    def unplug(self) -> None:
        self.close()
        self._plugged = False
        self._listener = self._bound()

    def descriptors(self) -> list[int]:
        listening = [self._listener] if self._plugged else []
        connected = [self._client] if self._client else []
        return [each.fileno() for each in (*listening, *connected)]

    def receive(self, ready: Sequence[int]) -> bytes:
        data = b""
        if self._client is not None and self._client.fileno() in ready:
            data = self._read(self._client)
        if self._listener.fileno() in ready:
            # A client that closes and connects again is gone only once all it sent has been read.
            while self._client is not None and (rest := self._read(self._client)):
                data += rest
            self._accept()
        return data

    def send(self, data: bytes, wait_s: float = 0.0) -> None:
        if (client := self._client) is not None:
            with suppress(OSError, ValueError):  # the client may be dropped meanwhile
                _write_or_drop(client.fileno(), data, wait_s)

    def close(self) -> None:
        self._drop()
        self._listener.close()

    def _bound(self) -> socket.socket:
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((LOOPBACK, self._port))
        return listener

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        if self._client is not None:  # a serial port refuses a second client too
            client.close()
            return
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client
        self.connections += 1

    def _read(self, client: socket.socket) -> bytes:
        try:
            data = client.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._drop()
        return data

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None


SerialLine = PtyLine | SocketLine


def _write_or_drop(descriptor: int, data: bytes, wait_s: float) -> None:
    """Write to a non-blocking descriptor; what finds no room within ``wait_s`` is dropped."""
    while data:
        if not select.select([], [descriptor], [], wait_s)[1]:
            return
        data = data[os.write(descriptor, data) :]
