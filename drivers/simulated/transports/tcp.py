"""A simulated serial line on a TCP port of the loopback interface."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from contextlib import suppress

from drivers.simulated.transports.interface import CHUNK, write_or_drop

LOOPBACK = "127.0.0.1"


class SocketTransport:
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
    def url(self) -> str:
        """``socket://`` address and port."""
        return f"socket://{LOOPBACK}:{self._port}"

    def plug_in(self) -> None:
        """Accept clients."""
        self._listener.listen(1)
        self._plugged = True

    def unplug(self) -> None:
        """Drop the client; keep the port without accepting clients."""
        self.close()
        self._plugged = False
        self._listener = self._bound()

    def descriptors(self) -> list[int]:
        """The listener while plugged in, and the client."""
        listening = [self._listener] if self._plugged else []
        connected = [self._client] if self._client else []
        return [each.fileno() for each in (*listening, *connected)]

    def receive(self, ready: Sequence[int]) -> bytes:
        """Bytes from the client; accepts one if there is none."""
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
        """Send to the client, if there is one."""
        client = self._client
        if client is not None:
            with suppress(OSError, ValueError):  # the client may be dropped meanwhile
                write_or_drop(client.fileno(), data, wait_s)

    def close(self) -> None:
        """Drop the client and close the port."""
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
