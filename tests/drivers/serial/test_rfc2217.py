"""A gauge behind a network server that speaks RFC 2217, with pyserial's own half of such a server."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, cast

import pytest
import serial
from serial.rfc2217 import PortManager

from drivers.errors import PortLost
from drivers.serial.shared_port import SharedSerialPort

LONG_S = 30.0

# pyserial 3.5 calls setDaemon there
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


class Server:
    """Answers every line with a value, after the negotiation that pyserial does."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self.baudrate = 0
        self._client: socket.socket | None = None
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def write(self, data: bytes) -> None:
        """What the manager sends of its own accord."""
        assert self._client is not None
        self._client.sendall(data)

    def drop(self) -> None:
        """End the connection."""
        assert self._client is not None
        self._client.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        if self._client is not None:
            self._client.close()
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)  # wakes the thread that waits for a client
        self._listener.close()
        self._thread.join()

    def _serve(self) -> None:
        device: Any = serial.serial_for_url("loop://", timeout=0)
        try:
            self._client, _ = self._listener.accept()
        except OSError:
            return
        manager = PortManager(device, cast("Any", self))
        received = b""
        with self._client:
            while chunk := self._received():
                received += b"".join(manager.filter(chunk))
                self.baudrate = device.baudrate
                while b"\r" in received:
                    _, _, received = received.partition(b"\r")
                    self.write(b"".join(manager.escape(b"\0+1.234\r")))
        device.close()

    def _received(self) -> bytes:
        try:
            assert self._client is not None
            return self._client.recv(1024)
        except OSError:
            return b""


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    yield made
    made.close()


async def test_requests_and_settings_reach_the_gauge(server: Server) -> None:
    line = SharedSerialPort(server.url, {"baudrate": 4800, "dtr": True, "rts": False, "exclusive": True})
    await line.open()
    assert await line.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
    assert await line.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
    assert server.baudrate == 4800
    await line.close()


async def test_a_connection_that_ends_is_a_lost_port(server: Server) -> None:
    line = SharedSerialPort(server.url, {"baudrate": 9600})
    await line.open()
    await line.exchange(b"?\r", b"\r", LONG_S)
    server.drop()
    with pytest.raises(PortLost, match="was lost"):
        await line.exchange(b"?\r", b"\r", LONG_S)
    await line.close()
