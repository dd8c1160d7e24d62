"""Sockets in a folder of their own, and clients of them."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from hexacell.run_process.audience import Audience
from hexacell.run_process.client import HostConnection, connect_to_run
from hexacell.run_process.messages import ControlChanged, HostMessage, StatusChanged, message_line
from hexacell.run_process.run_socket import listening_socket
from procedures.engine.command_loop import Status

FIRST = StatusChanged(status=Status.IDLE)
"""What every client of a scripted run is told first."""


class Client:
    """A connection, and all that it has told so far."""

    def __init__(self, connection: HostConnection) -> None:
        self.connection = connection
        self.told: list[HostMessage] = []
        self.is_over = False
        self._messages = connection.messages()

    async def until(self, condition: Callable[[HostMessage], bool]) -> Any:
        """The next message for which something holds."""
        async for message in self._messages:
            self.told.append(message)
            if condition(message):
                return message
        self.is_over = True
        pytest.fail(f"it ended with {self.told[-3:]}")

    async def until_over(self) -> list[HostMessage]:
        """Everything, to the end of the connection."""
        async for message in self._messages:
            self.told.append(message)
        self.is_over = True
        return self.told

    async def until_control(self, *, is_in_control: bool) -> ControlChanged:
        told: ControlChanged = await self.until(
            lambda one: isinstance(one, ControlChanged) and one.is_in_control is is_in_control
        )
        return told

    def hang_up(self) -> None:
        """Be gone without a word, as a terminal that was killed."""
        self.connection._writer.transport.abort()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Of a socket."""
    return tmp_path / "s" / "run.sock"


class Connected:
    """What clients of a socket are connected to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._clients: list[Client] = []

    async def client(self) -> Client:
        connection = await connect_to_run(self.path)
        assert connection is not None
        self._clients.append(Client(connection))
        return self._clients[-1]

    def close(self) -> None:
        for client in self._clients:
            client.connection._writer.close()


class ScriptedRun(Connected):
    """An audience without an engine, and what it was asked for."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.calls: asyncio.Queue[Any] = asyncio.Queue()
        note = self.calls.put_nowait
        self.audience = Audience(
            lambda: [message_line(FIRST)],
            on_command=note,
            on_control=lambda: note("control"),
            on_leave=lambda leave: note("lost" if leave is None else ("left", leave.keep_running)),
        )


MakeRun = Callable[..., AbstractAsyncContextManager[ScriptedRun]]


@pytest.fixture
def scripted_run(path: Path, monkeypatch: pytest.MonkeyPatch) -> MakeRun:
    @asynccontextmanager
    async def run(stuck_s: float = 3600.0) -> AsyncIterator[ScriptedRun]:
        monkeypatch.setattr("hexacell.run_process.audience.STUCK_S", stuck_s)
        with listening_socket(path) as listener:
            scripted = ScriptedRun(path)
            server = await asyncio.start_unix_server(scripted.audience.serve, sock=listener)
            yield scripted
            scripted.close()
            await scripted.audience.dismiss()
            server.close()
            await server.wait_closed()

    return run
