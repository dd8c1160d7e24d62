"""A plain client of linuxcncrsh, apart from the program's own driver."""

import socket
from types import TracebackType
from typing import Self


class ServerClient:
    """One connection that may command; every answer is one line."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._lines = connection.makefile("rb")
        assert self.ask("hello EMC test 1.0").startswith("HELLO ACK")
        self.send("set enable EMCTOO")
        self.send("set echo off")
        self.send("set verbose on")
        while "VERBOSE ACK" not in self._line():
            pass

    def ask(self, command: str) -> str:
        """The answer to a command."""
        self.send(command)
        return self._line()

    def get(self, what: str) -> list[float]:
        """The numbers behind the name of a value."""
        return [float(word) for word in self.ask(f"get {what}").split()[1:]]

    def send(self, command: str) -> None:
        """Send a command, without waiting for an answer."""
        self._connection.sendall(command.encode() + b"\r\n")

    def make_ready(self) -> None:
        """On, homed, and waiting for blocks."""
        for command in ("estop off", "machine on", "mode manual", "home -1"):
            assert "ACK" in self.ask(f"set {command}"), command
        while self.ask("get joint_homed").split()[1:] != ["YES"] * 6:
            pass
        for command in ("set_wait done", "mode mdi"):
            assert "ACK" in self.ask(f"set {command}"), command

    def close(self) -> None:
        """End the connection."""
        self._lines.close()  # a socket stays open as long as a file of it is
        self._connection.close()

    def _line(self) -> str:
        while read := self._lines.readline():
            if line := read.decode().strip():
                return line
        raise ConnectionError("LinuxCNC closed the connection")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
