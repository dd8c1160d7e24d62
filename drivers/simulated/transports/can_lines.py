"""The far end of a serial line: a pseudo-terminal, or a loopback TCP socket."""

from __future__ import annotations

import os
import pty
import select
import socket
import tty
from contextlib import suppress
from typing import Protocol

CHUNK = 4096
PATIENCE_S = 0.2
"""How long a reader may leave a full buffer before what is sent gets lost."""


class SerialLine(Protocol):
    """What a server needs of a serial line; one client at a time."""

    @property
    def url(self) -> str:
        """What pyserial opens to reach it."""
        ...

    def read(self, timeout_s: float) -> bytes | None:
        """What came in, nothing after ``timeout_s``, or none when the client has left."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of ``data``, or lose it if nobody reads."""
        ...

    def close(self) -> None:
        """Cut the line."""
        ...


class PtyLine:
    """A pseudo-terminal; its client opens a device path."""

    def __init__(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)

    @property
    def url(self) -> str:
        """The device path."""
        return os.ttyname(self._slave)

    def read(self, timeout_s: float) -> bytes | None:
        """What came in. As the slave is kept open here too, a client that leaves is not noticed."""
        return _read(self._master, timeout_s)

    def write(self, data: bytes) -> None:
        """Send all of ``data``, or lose it if nobody reads."""
        _write(self._master, data)

    def close(self) -> None:
        """Hang up."""
        os.close(self._master)
        os.close(self._slave)


class SocketLine:
    """A TCP server on the loopback interface; its client opens a ``socket://`` URL."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=1)
        self._client: socket.socket | None = None

    @property
    def url(self) -> str:
        """The URL with the port that was free."""
        return f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def read(self, timeout_s: float) -> bytes | None:
        """What came in; while there is no client, wait for one."""
        if self._client is None:
            self._accept(timeout_s)
            return b""
        try:
            data = _read(self._client.fileno(), timeout_s)
        except OSError:
            data = None
        if data is None:
            self._drop_client()
        return data

    def write(self, data: bytes) -> None:
        """Send all of ``data``, or lose it if nobody reads."""
        client = self._client
        if client is not None:
            with suppress(OSError):
                _write(client.fileno(), data)

    def close(self) -> None:
        """Hang up and listen no more."""
        self._drop_client()
        self._listener.close()

    def _accept(self, timeout_s: float) -> None:
        if select.select([self._listener], [], [], timeout_s)[0]:
            client, _ = self._listener.accept()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client = client

    def _drop_client(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()


def _read(descriptor: int, timeout_s: float) -> bytes | None:
    if not select.select([descriptor], [], [], timeout_s)[0]:
        return b""
    return os.read(descriptor, CHUNK) or None


def _write(descriptor: int, data: bytes) -> None:
    while data:
        if not select.select([], [descriptor], [], PATIENCE_S)[1]:
            return
        data = data[os.write(descriptor, data) :]
