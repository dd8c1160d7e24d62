"""The simulated controller as a TCP server on the loopback interface: lines in, responses out.

Responses to ``get`` end with CR LF, responses to ``set`` with LF CR, a refused ``get`` with two CR LF;
after the greeting, input is echoed unchanged. (Traces of LinuxCNC 2.9.)
"""

import re
import socket
import socketserver
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from drivers.simulated.linuxcnc.state import ConnectionCut, ControllerState, Machine, TaskMode
from hexacell.cell.robot import ControllerSettings

HOST = "127.0.0.1"
SERVER = "EMCNETSVR 1.1"
MAX_LINE_BYTES = 255
UNITS = {1.0: "MM", 10.0: "CM", 25.4: "INCH"}

_LINE_ENDS = re.compile(rb"[\r\n]")
_CHUNK = 1600
_POLL_S = 0.05


class _Handler(socketserver.BaseRequestHandler):
    server: "SimulatedController"
    request: socket.socket

    def handle(self) -> None:
        client = _Client(self.server, self.request.sendall)
        with suppress(OSError, ConnectionCut):
            while data := self.request.recv(_CHUNK):
                if self.server.hears():
                    client.receive(data)


class SimulatedController(socketserver.ThreadingTCPServer):
    """Serves clients until it is closed, each in a thread of its own, as the real one does.

    Attributes:
        port: where it listens, on 127.0.0.1.
        state: the state that its clients share.
        is_silent: every line is lost without a response.
        frozen_answers: by query, while the controller behind the server is frozen.
    """

    daemon_threads = False
    handler: type[socketserver.BaseRequestHandler] = _Handler

    def __init__(self, machine: Machine, settings: ControllerSettings) -> None:
        self.state = ControllerState(machine)
        self.settings = settings
        self.is_silent = self._is_unplugged = False
        self.frozen_answers: Mapping[str, str] | None = None
        self._connections: set[socket.socket] = set()
        super().__init__((HOST, 0), self.handler)
        self.port = self.server_address[1]
        self._thread = threading.Thread(
            target=self.serve_forever, args=(_POLL_S,), name="simulated controller"
        )
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self.close()

    def hears(self) -> bool:
        """Whether a client is heard."""
        return not self.is_silent

    def set_unplugged(self, *, on: bool) -> None:
        """Cut every connection and accept no other, or accept them again; the machine continues."""
        self._is_unplugged = on
        if on:
            self._cut_all()

    def set_frozen(self, *, on: bool) -> None:
        """Answer every query as it would be answered now and carry out nothing, or work again.

        The machine continues. Of LinuxCNC, this is what a stopped milltask does.
        """
        anybody = _Client(self, lambda _data: None)
        self.frozen_answers = (
            {what: get(anybody) for what, get in _GET.items() if what not in _OF_SERVER} if on else None
        )

    def close(self) -> None:
        """Stop serving, and the machine."""
        self.shutdown()
        self.state.close()
        self._cut_all()
        self.server_close()
        self._thread.join()

    def get_request(self) -> tuple[socket.socket, tuple[str, int]]:
        connection, address = super().get_request()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connections.add(connection)
        return connection, address

    def verify_request(self, request: object, client_address: object) -> bool:
        del request, client_address
        return not self._is_unplugged

    def shutdown_request(self, request: socket.socket | tuple[bytes, socket.socket]) -> None:
        assert isinstance(request, socket.socket)  # noqa: S101 - a TCP server has no datagrams
        self._connections.discard(request)
        super().shutdown_request(request)

    def _cut_all(self) -> None:
        """Cut all connections, which ends the wait of every handler."""
        for connection in tuple(self._connections):
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)


class _Client:
    """The settings, lines and responses of one connection; ``write`` sends bytes back over it."""

    def __init__(self, server: SimulatedController, write: Callable[[bytes], None]) -> None:
        self.state = server.state
        self.settings = server.settings
        self.echo = True
        self.verbose = False
        self._server = server
        self._greeted = False
        self._is_waiting = False
        self._write = write
        self._rest = b""

    @property
    def has_control(self) -> bool:
        return self.state.commander is self

    def receive(self, data: bytes) -> None:
        """Process received bytes and respond to every completed line.

        Raises:
            ConnectionCut: The client sent ``quit`` or a line that is too long.
        """
        if self.echo and self._greeted:
            self._write(data)
        *lines, self._rest = _LINE_ENDS.split(self._rest + data)
        for line in lines:
            if len(line) > MAX_LINE_BYTES:
                raise ConnectionCut
            self._execute(line.decode("utf-8", "replace"))

    def _execute(self, line: str) -> None:
        verb, what, argument = (*line.split(maxsplit=2), "", "", "")[:3]
        verb = verb.upper()
        if self._is_stuck(verb, what.upper()):
            return
        match verb:
            case "HELLO":
                expected = self.settings.connect_password.get_secret_value()
                if what == expected and len(argument.split()) >= 2:
                    self._greeted = True
                    self._write(f"HELLO ACK {SERVER}\r\n".encode())
                else:
                    self._write(b"HELLO NAK\r\n")
            case "GET":
                self._write(self._got(what.upper()).encode())
            case "SET":
                self._write(self._set(what.upper(), argument.strip()).encode())
            case "QUIT":
                raise ConnectionCut

    def _is_stuck(self, verb: str, what: str) -> bool:
        """Whether the server waits for a frozen controller with this command, or with an earlier one."""
        is_frozen = self._server.frozen_answers is not None
        is_for_machine = verb == "SET" and what in _SET and what not in _OF_SERVER
        self._is_waiting = is_frozen and (self._is_waiting or is_for_machine)
        return self._is_waiting

    def _got(self, what: str) -> str:
        if not what:
            return "GET NAK\r\n"
        if what not in _GET:
            return f"GET {what} NAK\r\n\r\n"
        frozen = self._server.frozen_answers or {}
        return f"{what} {frozen[what] if what in frozen else _GET[what](self)}\r\n"

    def _set(self, what: str, argument: str) -> str:
        if not self._greeted:
            return "SET NAK\r\n"
        if not what:
            return "SET NAK\n\r"
        is_permitted = (what in _FOR_ANYBODY or self.has_control) and (
            what not in _WHILE_ON or self.state.enabled
        )
        if what not in _SET or not is_permitted or not _SET[what](self, argument):
            return f"SET {what} NAK\n\r"
        return f"SET {what} ACK\n\r" if self.verbose else ""


def _switch(is_on: bool) -> str:
    return "ON" if is_on else "OFF"


def _answer(is_so: bool) -> str:
    return "YES" if is_so else "NO"


def _numbers(values: Iterable[float], unit: float = 1.0) -> str:
    """Lengths in the machine's unit; angles come with unit 1."""
    return " ".join(f"{value / unit:.6f}" for value in values)


def _position(client: _Client, values: tuple[float, ...]) -> str:
    """Three lengths in the machine's unit, and three angles."""
    return f"{_numbers(values[:3], client.settings.unit_mm)} {_numbers(values[3:])}"


_GET: dict[str, Callable[[_Client], str]] = {
    "ENABLE": lambda client: _switch(client.has_control),
    "ESTOP": lambda client: _switch(client.state.estop),
    "MACHINE": lambda client: _switch(client.state.enabled),
    "MODE": lambda client: client.state.mode.value,
    "ERROR": lambda client: client.state.next_error(),
    "TELEOP_ENABLE": lambda client: _answer(client.state.teleop),
    "JOINT_HOMED": lambda client: " ".join([_answer(client.state.homed)] * 6),
    "JOINT_POS": lambda client: _numbers(client.state.machine.joints(), client.settings.joint_unit_mm),
    "ABS_ACT_POS": lambda client: _position(client, client.state.machine.pose().as_tuple()),
    "POS_OFFSET": lambda client: _position(client, client.state.modes.offset),
    "PROGRAM_CODES": lambda client: client.state.modes.codes,
    "FEED_OVERRIDE": lambda client: f"{client.state.feed_override_percent:g}",
    "USER_LINEAR_UNITS": lambda client: UNITS.get(client.settings.unit_mm, "CUSTOM"),
    "INIFILE": lambda client: Path(client.settings.config).name,
}

SettingT = TypeVar("SettingT")


def _one_of(
    settings: Mapping[str, SettingT], change: Callable[[_Client, SettingT], None]
) -> Callable[[_Client, str], bool]:
    """The effect of a command whose argument is one of some words."""

    def execute(client: _Client, argument: str) -> bool:
        word = argument.upper()
        if word in settings:
            change(client, settings[word])
        return word in settings

    return execute


def _enable(client: _Client, argument: str) -> bool:
    is_password = argument == client.settings.enable_password.get_secret_value()
    if is_password or argument.upper() == "OFF":
        client.state.commander = client if is_password else None
        return True
    return False


def _abort(client: _Client, _argument: str) -> bool:
    client.state.abort()
    return True


_SWITCH = {"ON": True, "OFF": False}
_WAIT = {"DONE": True, "RECEIVED": False}
_TASK_MODES = {mode.value: mode for mode in TaskMode}

_SET: dict[str, Callable[[_Client, str], bool]] = {
    "ECHO": _one_of(_SWITCH, lambda client, on: setattr(client, "echo", on)),
    "VERBOSE": _one_of(_SWITCH, lambda client, on: setattr(client, "verbose", on)),
    "ENABLE": _enable,
    "SET_WAIT": _one_of(_WAIT, lambda client, waits: setattr(client.state, "waits", waits)),
    "ESTOP": _one_of(_SWITCH, lambda client, on: client.state.set_estop(on=on)),
    "MACHINE": _one_of(_SWITCH, lambda client, on: client.state.set_machine(on=on)),
    "MODE": _one_of(_TASK_MODES, lambda client, mode: client.state.set_mode(mode)),
    "TELEOP_ENABLE": _one_of(_SWITCH, lambda client, on: setattr(client.state, "teleop", on)),
    "HOME": _one_of({"-1": -1}, lambda client, _joints: client.state.home()),
    "MDI": lambda client, block: client.state.mdi(block),
    "ABORT": _abort,
}
"""The effects of commands after ``set``, given what follows their name; false becomes NAK."""

_OF_SERVER = frozenset({"ECHO", "VERBOSE", "ENABLE", "SET_WAIT"})
"""What the server answers by itself, whatever the controller does."""
_FOR_ANYBODY = frozenset({"ECHO", "VERBOSE", "ENABLE"})
"""What any client may set; all else, only the one in control."""
_WHILE_ON = frozenset({"MODE", "TELEOP_ENABLE", "HOME", "MDI", "ABORT"})
"""What can be set only while the machine is on."""
