"""One connection to linuxcncrsh: greeting, then one command and one response at a time."""

import errno
import logging
import os
import re
import select
import socket
import threading
import time
from collections import deque
from contextlib import suppress
from typing import Self

from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.linuxcnc import shell_protocol as protocol
from drivers.errors import ConnectionLost, ResponseTimeout
from drivers.wire_trace import LineRecord, TrafficDirection
from hexacell.cell.robot import ControllerSettings
from hexacell.clock import Patience
from hexacell.storage.atomic_files import SHORTAGES

_log = logging.getLogger("drivers.controllers.linuxcnc")

_CLIENT = "hexacell 1.0"
_CHUNK = 4096
_SHOWN = 80
_SLICE_S = 0.05
PARSED_S = 0.02
"""Within this time, s, LinuxCNC has read a command that was sent."""


class Connection:
    """A connected and greeted client, used by one thread at a time.

    A response that did not come in time stays outstanding, and is received before the next command, so
    that it is never taken for the response to another one.

    Attributes:
        server: name and version of the server.
    """

    def __init__(
        self, settings: ControllerSettings, limits: protocol.Limits, wire: LineRecord, line: threading.Lock
    ) -> None:
        """Connect, which raises ``ConnectionLost``; ``line`` is shared by all that may send.

        LinuxCNC 2.9 reads the commands of all clients with one ``strtok()``: two that arrive at the same
        moment garble each other.
        """
        self.server = ""
        self._settings, self._limits, self._wire, self._line = settings, limits, wire, line
        self._subject = f"controller {settings.host}:{settings.port}"
        self._buffer = protocol.LineBuffer()
        self._lines: deque[str] = deque()
        self._outstanding: str | None = None
        self._remarks: list[str] = []
        self._socket = self._connected()

    @classmethod
    def open(
        cls,
        settings: ControllerSettings,
        limits: protocol.Limits,
        wire: LineRecord,
        line: threading.Lock,
        *,
        commanding: bool,
    ) -> Self:
        """Connect, greet, switch echo off and verbose on and, if ``commanding``, take control.

        Raises:
            ConnectionLost: Nothing listens there, or it does not respond.
            FailedError: Something else listens there, or a password is wrong.
        """
        connection = cls(settings, limits, wire, line)
        try:
            connection._greet()
            if commanding:
                connection.take_control()
        except BaseException:
            connection.close()
            raise
        _log.info("%s: connected to %s", connection._subject, connection.server)
        return connection

    def request(self, command: str, timeout_s: float | None = None) -> protocol.Response:
        """Send one command; its response, a refusal included.

        Raises:
            ResponseTimeout: No response within ``timeout_s``.
            ConnectionLost: The connection broke.
        """
        self.send(command)
        timeout_s = timeout_s or self._limits.answer
        if (response := self.response(timeout_s)) is None:
            raise self._silent(command, timeout_s)
        return response

    def send(self, command: str) -> None:
        """Send one command, after the response to the last one; its own is awaited by ``response``."""
        if self._outstanding is not None and self.response(self._limits.answer) is None:
            raise self._silent(self._outstanding, self._limits.answer)
        data = protocol.encode_command(command)
        with self._line:
            self._lines.clear()  # an answer that came twice would be taken for that to this command
            self._outstanding = command
            self._write(data)
            self._receive(PARSED_S)

    def response(self, timeout_s: float) -> protocol.Response | None:
        """The outstanding response, if it comes in this time."""
        assert self._outstanding is not None  # noqa: S101 - who waits has sent
        patience = Patience(timeout_s, _SLICE_S, time.monotonic())
        while True:
            while self._lines:
                line = self._lines.popleft()
                if answer := protocol.parse_response(line, self._outstanding):
                    return self._responded(answer)
                if explanation := protocol.parse_explanation(line):
                    self._remarks.append(explanation)
                    left_s = min(patience.left_s(time.monotonic()), self._limits.explanation)
                    patience = Patience(left_s, _SLICE_S, time.monotonic())
            if (left_s := patience.left_s(time.monotonic())) <= 0.0:
                # 2.10 refuses without a NAK while another client moves the machine
                return self._responded(protocol.Response(accepted=False)) if self._remarks else None
            self._receive(min(left_s, _SLICE_S))

    @property
    def is_waiting(self) -> bool:
        """Whether a response is outstanding."""
        return self._outstanding is not None

    def take_control(self, timeout_s: float | None = None) -> None:
        """Become the client that may command; on LinuxCNC 2.9 the previous one loses control.

        Raises:
            FailedError: The password is wrong.
        """
        password = self._settings.enable_password.get_secret_value()
        if not self.request(f"set enable {password}", timeout_s).accepted:
            action = "Set enable_password in the password_file to linuxcncrsh's own (--enablepw)"
            raise FailedError("fault", "it refuses the enable password", action=action)

    def close(self) -> None:
        """Close the connection, at which whoever waits for it fails; closing twice is harmless."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _connected(self) -> socket.socket:
        settings, limit_s = self._settings, self._limits.connect
        try:
            connection = socket.create_connection((settings.host, settings.port), timeout=limit_s)
        except OSError as error:
            number = error.errno or 0  # negative from getaddrinfo, which has its own text
            reason = f": {os.strerror(number) if number > 0 else error.strerror}" if number else ""
            action = "Switch its computer on, check network and firewall, or correct controller.host"
            if number == errno.ECONNREFUSED:
                action = "Start LinuxCNC with DISPLAY = linuxcncrsh --port N, or correct controller.port"
            action = SHORTAGES.get(number, ("", action))[1]
            problem = f"cannot be reached{reason or f' within {limit_s:g} s'}"
            raise ConnectionLost(problem, subject=self._subject, action=action) from error
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection

    def _greet(self) -> None:
        password = self._settings.connect_password.get_secret_value()
        with self._line:
            self._write(protocol.encode_command(f"hello {password} {_CLIENT}"))
            line = self._greeting()
        match line.split():
            case ["HELLO", "ACK", *server]:
                self.server = " ".join(server)
            case ["HELLO", "NAK"]:
                action = "Set connect_password in the password_file to linuxcncrsh's own (--connectpw)"
                raise FailedError("fault", "it refuses the connect password", action=action)
            case _:
                raise _not_linuxcncrsh(line)
        with self._line:
            self._write(protocol.encode_command("set echo off"))
            self._next_line(self._limits.explanation)  # the only response, if any, is the echo
        self.request("set verbose on")

    def _greeting(self) -> str:
        while (line := self._next_line(self._limits.answer)) is not None:
            if not line.lower().startswith("warning:"):
                return line
        if self._buffer.rest:
            raise _not_linuxcncrsh(self._buffer.rest)
        problem = "is frozen: it accepts the connection but does not respond"
        action = "Check that linuxcncrsh listens there, and restart LinuxCNC"
        raise ResponseTimeout(problem, subject=self._subject, action=action)

    def _next_line(self, timeout_s: float) -> str | None:
        patience = Patience(timeout_s, _SLICE_S, time.monotonic())
        while not self._lines and (left_s := patience.left_s(time.monotonic())) > 0.0:
            self._receive(min(left_s, _SLICE_S))
        return self._lines.popleft() if self._lines else None

    def _responded(self, answer: protocol.Response) -> protocol.Response:
        self._outstanding, remarks, self._remarks = None, tuple(self._remarks), []
        return protocol.Response(answer.accepted, answer.text, remarks)

    def _write(self, data: bytes) -> None:
        self._record(TrafficDirection.SENT, data)
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise self._closed() from error

    def _receive(self, timeout_s: float) -> None:
        """Take what comes in this time."""
        try:
            if not select.select([self._socket], [], [], timeout_s)[0]:
                return
            data = self._socket.recv(_CHUNK)
        except (OSError, ValueError):  # the latter of a socket that was closed meanwhile
            data = b""
        if not data:
            raise self._closed()
        self._record(TrafficDirection.RECEIVED, data)
        self._lines.extend(self._buffer.feed(data))

    def _silent(self, command: str, timeout_s: float) -> ResponseTimeout:
        asked = " ".join(command.split()[:2])  # no passwords in messages
        problem = f"is frozen: it is connected, but did not answer '{asked}' within {timeout_s:g} s"
        return ResponseTimeout(problem, subject=self._subject, action="Restart LinuxCNC, and find out why")

    def _closed(self) -> ConnectionLost:
        what, action = "it was ended or restarted", "Start LinuxCNC if it does not run"
        if not self.server:  # it counts those that have left as well
            what = "it was ended, or takes no more clients than the --sessions that it was started with"
            action = "Restart LinuxCNC, with linuxcncrsh without --sessions"
        return ConnectionLost(f"closed the connection: {what}", subject=self._subject, action=action)

    def _record(self, direction: TrafficDirection, data: bytes) -> None:
        if self._wire.is_on:
            self._wire.add(direction, without_passwords(data, self._settings))


def _not_linuxcncrsh(said: str) -> FailedError:
    action = "Check controller.host and controller.port"
    return FailedError("fault", f"it is no linuxcncrsh, it says {said[:_SHOWN]!r}", action=action)


def without_passwords(data: bytes, settings: ControllerSettings) -> bytes:
    """Traffic with every password masked as a whole, even where one begins with the other."""
    for secret in (settings.connect_password, settings.enable_password):
        password = re.escape(secret.get_secret_value().encode())
        data = re.sub(rb"(?<= )" + password + rb"(?![^\s])", b"***", data)
    return data
