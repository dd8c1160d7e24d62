"""The simulated controller as a TCP server on the loopback interface: lines in, responses out.

Responses to ``get`` end with CR LF, responses to ``set`` with LF CR, a refused ``get`` with two CR LF;
after the greeting, input is echoed unchanged. (Traces of LinuxCNC 2.9.)
"""

from __future__ import annotations

import re
import socket
import socketserver
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress

from drivers.simulated.linuxcnc.commands import (
    GET_COMMANDS,
    OF_SERVER,
    SET_COMMANDS,
    ClientSession,
    Permission,
)
from drivers.simulated.linuxcnc.state import ConnectionCut, ControllerState, Machine
from drivers.simulated.served_device import Closeable
from hexacell.cell.controller import ControllerSettings

HOST = "127.0.0.1"
SERVER = "EMCNETSVR 1.1"
MAX_LINE_BYTES = 255

_LINE_ENDS = re.compile(rb"[\r\n]")
_CHUNK = 1600
_POLL_S = 0.05


class SimulatedController(Closeable):
    """Serves clients until it is closed, each in a thread of its own, as the real one does.

    Attributes:
        port: where it listens, on 127.0.0.1.
        state: the state that its clients share.
    """

    def __init__(self, machine: Machine, settings: ControllerSettings) -> None:
        self.state = ControllerState(machine)
        self._server = _Server(self.state, settings)
        self.port = self._server.server_address[1]
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(_POLL_S,), name="simulated controller"
        )
        self._thread.start()

    def set_unplugged(self, *, on: bool) -> None:
        """Cut every connection and accept no other, or accept them again; the machine continues."""
        self._server.unplugged = on
        if on:
            self._server.cut_all()

    def set_silent(self, *, on: bool) -> None:
        """Lose every line without a response, or no more."""
        self._server.silent = on

    def set_frozen(self, *, on: bool) -> None:
        """Answer every query as it would be answered now and carry out nothing, or work again.

        The machine continues. Of LinuxCNC, this is what a stopped milltask does.
        """
        self._server.frozen_answers = _answers_now(self._server) if on else None

    def close(self) -> None:
        self._server.shutdown()
        self.state.close()
        self._server.cut_all()
        self._server.server_close()
        self._thread.join()


class _Server(socketserver.ThreadingTCPServer):
    daemon_threads = False

    def __init__(self, state: ControllerState, settings: ControllerSettings) -> None:
        self.state = state
        self.settings = settings
        self.unplugged = False
        self.silent = False
        self.frozen_answers: Mapping[str, str] | None = None
        self._connections: set[socket.socket] = set()
        super().__init__((HOST, 0), _Handler)

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


def _answers_now(server: _Server) -> Mapping[str, str]:
    """The answers to queries for the machine's state, by their names."""
    anybody = ClientSession(server.state, server.settings)
    return {what: get(anybody) for what, get in GET_COMMANDS.items() if what not in OF_SERVER}


class _Handler(socketserver.BaseRequestHandler):
    server: _Server
    request: socket.socket

    def handle(self) -> None:
        client = _Client(self.server, self.request.sendall)
        with suppress(OSError, ConnectionCut):
            while data := self.request.recv(_CHUNK):
                if not self.server.silent:
                    client.receive(data)


class _Client:
    """The lines and responses of one connection; ``write`` sends bytes back over it."""

    def __init__(self, server: _Server, write: Callable[[bytes], None]) -> None:
        self._server = server
        self._session = ClientSession(server.state, server.settings)
        self._is_waiting = False
        self._write = write
        self._rest = b""

    def receive(self, data: bytes) -> None:
        """Process received bytes and respond to every completed line.

        Raises:
            ConnectionCut: The client sent ``quit`` or a line that is too long.
        """
        if self._session.echo and self._session.greeted:
            self._write(data)
        *lines, self._rest = _LINE_ENDS.split(self._rest + data)
        for line in lines:
            if len(line) > MAX_LINE_BYTES:
                raise ConnectionCut
            self._execute(line.decode("utf-8", "replace"))

    def _execute(self, line: str) -> None:
        verb, what, argument = (*line.split(maxsplit=2), "", "", "")[:3]
        if self._is_stuck(verb.upper(), what.upper()):
            return
        match verb.upper():
            case "HELLO":
                self._hello(what, argument)
            case "GET":
                self._get(what.upper())
            case "SET":
                self._set(what.upper(), argument.strip())
            case "QUIT":
                raise ConnectionCut

    def _is_stuck(self, verb: str, what: str) -> bool:
        """Whether the server waits for a frozen controller with this command, or with an earlier one."""
        is_frozen = self._server.frozen_answers is not None
        is_for_machine = verb == "SET" and what in SET_COMMANDS and what not in OF_SERVER
        self._is_waiting = is_frozen and (self._is_waiting or is_for_machine)
        return self._is_waiting

    def _hello(self, password: str, name_and_version: str) -> None:
        expected = self._session.settings.connect_password.get_secret_value()
        if password == expected and len(name_and_version.split()) >= 2:
            self._session.greeted = True
            self._write(f"HELLO ACK {SERVER}\r\n".encode())
        else:
            self._write(b"HELLO NAK\r\n")

    def _get(self, what: str) -> None:
        if not what:
            self._write(b"GET NAK\r\n")
        elif what in GET_COMMANDS:
            self._write(f"{what} {self._answer(what)}\r\n".encode())
        else:
            self._write(f"GET {what} NAK\r\n\r\n".encode())

    def _answer(self, what: str) -> str:
        frozen = self._server.frozen_answers or {}
        return frozen[what] if what in frozen else GET_COMMANDS[what](self._session)

    def _set(self, what: str, argument: str) -> None:
        if not self._session.greeted:
            self._write(b"SET NAK\r\n")
        elif not what:
            self._write(b"SET NAK\n\r")
        elif not (self._is_permitted(what) and SET_COMMANDS[what].execute(self._session, argument)):
            self._write(f"SET {what} NAK\n\r".encode())
        elif self._session.verbose:
            self._write(f"SET {what} ACK\n\r".encode())

    def _is_permitted(self, what: str) -> bool:
        if what not in SET_COMMANDS:
            return False
        permission = SET_COMMANDS[what].permission
        return (permission < Permission.COMMANDER or self._session.has_control) and (
            permission < Permission.ON or self._session.state.enabled
        )
