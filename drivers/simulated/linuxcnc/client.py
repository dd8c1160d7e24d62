"""One client of the simulated controller: lines in, responses out, byte for byte.

Responses to ``get`` end with CR LF, responses to ``set`` with LF CR, a refused ``get`` with two CR LF;
after the greeting, input is echoed unchanged. (Traces of LinuxCNC 2.9.)
"""

from __future__ import annotations

import re
from collections.abc import Callable

from drivers.simulated.linuxcnc.commands import (
    GET_COMMANDS,
    SET_COMMANDS,
    ClientSession,
    Permission,
    ServerSettings,
)
from drivers.simulated.linuxcnc.faults import ControllerFault, ControllerFaults
from drivers.simulated.linuxcnc.state import ConnectionCut, ControllerState

MAX_LINE_BYTES = 255

_LINE_ENDS = re.compile(rb"[\r\n]")


class Client:
    """One connection; ``write`` sends bytes back over it."""

    def __init__(
        self,
        control: ControllerState,
        faults: ControllerFaults,
        access: ServerSettings,
        write: Callable[[bytes], None],
    ) -> None:
        self._session = ClientSession(control, access)
        self._faults = faults
        self._write = write
        self._rest = b""

    def receive(self, data: bytes) -> None:
        """Process received bytes and respond to every completed line.

        Raises:
            ConnectionCut: The client sent ``quit`` or a line that is too long, or a fault cuts it off.
        """
        if self._faults.triggers(ControllerFault.SILENT):
            return
        if self._session.echo and self._session.greeted:
            self._write(data)
        *lines, self._rest = _LINE_ENDS.split(self._rest + data)
        for line in lines:
            if len(line) > MAX_LINE_BYTES:
                raise ConnectionCut
            self._execute(line.decode("utf-8", "replace"))

    def _execute(self, line: str) -> None:
        verb, what, argument = (*line.split(maxsplit=2), "", "", "")[:3]
        match verb.upper():
            case "HELLO":
                self._hello(what, argument)
            case "GET":
                self._get(what.upper())
            case "SET":
                self._set(what.upper(), argument.strip())
            case "QUIT":
                raise ConnectionCut

    def _hello(self, password: str, name_and_version: str) -> None:
        refused = self._faults.triggers(ControllerFault.REFUSES_PASSWORD)
        known = password == self._session.settings.connect_password and len(name_and_version.split()) >= 2
        if known and not refused:
            self._session.greeted = True
            self._write(f"HELLO ACK {self._session.settings.server}\r\n".encode())
        else:
            self._write(b"HELLO NAK\r\n")

    def _get(self, what: str) -> None:
        if not what:
            self._write(b"GET NAK\r\n")
        elif what in GET_COMMANDS:
            self._write(f"{what} {GET_COMMANDS[what](self._session)}\r\n".encode())
        else:
            self._write(f"GET {what} NAK\r\n\r\n".encode())

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
