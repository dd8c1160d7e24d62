"""The simulated controller as a TCP server on the loopback interface."""

from __future__ import annotations

import socket
import socketserver
import threading
from contextlib import suppress

from drivers.simulated.closeable import Closeable
from drivers.simulated.linuxcnc.client import Client
from drivers.simulated.linuxcnc.commands import ServerSettings
from drivers.simulated.linuxcnc.faults import ControllerFaults
from drivers.simulated.linuxcnc.machine import Machine
from drivers.simulated.linuxcnc.state import ConnectionCut, ControllerState

HOST = "127.0.0.1"

_CHUNK = 1600
_POLL_S = 0.05


class SimulatedController(Closeable):
    """Serves clients until it is closed, each in a thread of its own, as the real one does.

    Attributes:
        port: where it listens, on 127.0.0.1.
        faults: the active faults; may be changed at any time.
        state: the state that its clients share.
    """

    def __init__(
        self,
        machine: Machine,
        *,
        port: int = 0,
        connect_password: str = "EMC",  # noqa: S107 - linuxcncrsh's published default
        enable_password: str = "EMCTOO",  # noqa: S107 - same
        config: str = "simulated.ini",
    ) -> None:
        self.faults = ControllerFaults()
        self.state = ControllerState(machine, self.faults)
        access = ServerSettings(connect_password, enable_password, "EMCNETSVR 1.1", config)
        try:
            self._server = _Server(port, self.state, self.faults, access)
        except BaseException:
            self.state.close()
            raise
        self.port = self._server.server_address[1]
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(_POLL_S,), name="simulated controller"
        )
        self._thread.start()

    def unplug(self) -> None:
        """Cut every connection and accept no other; the machine continues."""
        self._server.unplugged = True
        self._server.cut_all()

    def plug_in(self) -> None:
        """Accept connections again."""
        self._server.unplugged = False

    def close(self) -> None:
        """Stop the machine, cut all connections and end all threads; closing twice is harmless."""
        self._server.shutdown()
        self.state.close()
        self._server.cut_all()
        self._server.server_close()
        self._thread.join()


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = False

    def __init__(
        self, port: int, control: ControllerState, faults: ControllerFaults, access: ServerSettings
    ) -> None:
        self.control = control
        self.faults = faults
        self.access = access
        self.unplugged = False
        self._connections: set[socket.socket] = set()
        super().__init__((HOST, port), _Handler)

    def get_request(self) -> tuple[socket.socket, tuple[str, int]]:
        connection, address = super().get_request()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connections.add(connection)
        return connection, address

    def verify_request(self, request: object, client_address: object) -> bool:
        del request, client_address
        return not self.unplugged

    def shutdown_request(self, request: socket.socket | tuple[bytes, socket.socket]) -> None:
        assert isinstance(request, socket.socket)  # noqa: S101 - a TCP server has no datagrams
        self._connections.discard(request)
        super().shutdown_request(request)

    def cut_all(self) -> None:
        """Cut all connections, which ends the wait of every handler."""
        for connection in tuple(self._connections):
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)


class _Handler(socketserver.BaseRequestHandler):
    server: _Server
    request: socket.socket

    def handle(self) -> None:
        shared = self.server
        client = Client(shared.control, shared.faults, shared.access, self.request.sendall)
        with suppress(OSError, ConnectionCut):
            while data := self.request.recv(_CHUNK):
                client.receive(data)
