"""A robot that is served within this process, by threads of its own: what a driver needs no program for."""

import asyncio
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol, Self

from drivers.controllers.adapter.served_robot import Robot, serve
from drivers.errors import ConnectionLost
from hexacell.errors import HexacellError


class LocalRobot(Robot, Protocol):
    """A robot whose connection to the controller may be lost: then it raises ``ConnectionLost``."""

    def close(self) -> None:
        """Close the connection, at which whoever waits for it fails; closing twice is harmless."""


class LocalProgram:
    """The threads that serve one robot, and the streams to them.

    Attributes:
        stdin: where requests are written, and ``stdout`` where answers are read.
    """

    def __init__(
        self,
        robot: LocalRobot,
        connection: socket.socket,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        self.stdin, self.stdout = writer, reader
        self._robot = robot
        self._lost: ConnectionLost | None = None
        self._thread = threading.Thread(target=self._serve, args=(connection,), daemon=True)
        self._thread.start()

    @classmethod
    async def start(cls, robot: LocalRobot, longest_line: int) -> Self:
        """Begin to serve a robot."""
        ours, theirs = socket.socketpair()
        reader, writer = await asyncio.open_connection(sock=ours, limit=longest_line)
        return cls(robot, theirs, reader, writer)

    async def ending(self) -> ConnectionLost | str:
        """Why it ended."""
        return self._lost or "ended"

    async def close(self, limit_s: float) -> None:
        """Wait for its end, its stdin being closed, and close the robot's connection."""
        await asyncio.to_thread(self._thread.join, limit_s)
        self._robot.close()

    def _serve(self, connection: socket.socket) -> None:
        def lose(error: ConnectionLost) -> None:
            self._lost = self._lost or error

        serve_over(connection, self._robot, lose)
        self._robot.close()


def serve_over(
    connection: socket.socket,
    robot: Robot,
    lose: Callable[[ConnectionLost], None] = lambda _error: None,
    hears: Callable[[], bool] = lambda: True,
) -> None:
    """Serve a robot over a connection until that ends, or the one to its controller is lost.

    Args:
        connection: to the client; it is closed.
        robot: which raises ``ConnectionLost`` where its controller is gone.
        lose: told of that.
        hears: whether a line is taken; others are lost.
    """

    def ends(error: Exception) -> bool:
        if is_lost := isinstance(error, ConnectionLost):
            lose(error)
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        return is_lost

    with (
        suppress(HexacellError, OSError),
        connection,
        connection.makefile() as lines,
        connection.makefile("w") as answers,
    ):
        serve(robot, (line for line in lines if hears()), answers, ends)
