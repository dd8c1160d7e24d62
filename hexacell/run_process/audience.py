"""Who is connected to a run: all receive everything, and one of them gives the commands."""

import asyncio
import os
from asyncio import StreamReader, StreamWriter
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from hexacell.errors import HexacellError, UsageError
from hexacell.run_process import messages
from hexacell.run_process.run_socket import peer_of
from hexacell.runs.cell_lock import user_name
from procedures.engine.commands import Command

STUCK_S = 10.0
"""A client that takes nothing for so long is let go, s."""


class Outbox:
    """Messages to one client, in order. Of snapshots only the latest waits, and only behind all others."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        writer.transport.set_write_buffer_limits(high=0)
        self._writer = writer
        self._lines: deque[bytes] = deque()
        self._latest: bytes | None = None
        self._changed = asyncio.Event()
        self._is_closed = False

    def put(self, line: bytes) -> None:
        """Add a message that must arrive."""
        self._lines.append(line)
        self._changed.set()

    def offer(self, line: bytes) -> None:
        """Add a snapshot, which replaces one that still waits."""
        self._latest = line
        self._changed.set()

    def close(self) -> None:
        """Nothing more is added: delivery ends when all is sent."""
        self._is_closed = True
        self._changed.set()

    async def deliver(self) -> None:
        """Send everything as the client takes it, until closed; raises ``OSError`` where it does not."""
        while (line := await self._next()) is not None:
            self._writer.write(line)
            try:
                await asyncio.wait_for(self._writer.drain(), STUCK_S)
            except TimeoutError as error:
                self._writer.transport.abort()
                raise ConnectionAbortedError("the client takes nothing") from error

    async def _next(self) -> bytes | None:
        while not self._lines and self._latest is None and not self._is_closed:
            self._changed.clear()
            await self._changed.wait()
        if self._lines:
            return self._lines.popleft()
        line, self._latest = self._latest, None
        return None if self._is_closed else line


@dataclass(eq=False)
class _Client:
    who: str
    outbox: Outbox
    leave: messages.Leave | None = None


class Audience:
    """The clients of one run.

    The first one to come gives the commands, then whoever takes control explicitly; who comes when nobody
    is in control gets it.

    Args:
        opening: gives the lines that a new client receives first, in order.
        on_command: takes the commands of who is in control.
        on_control: called when somebody is in control now.
        on_leave: called when who was in control has left; with None if without a word.
    """

    def __init__(
        self,
        opening: Callable[[], list[bytes]],
        *,
        on_command: Callable[[Command], None],
        on_control: Callable[[], None],
        on_leave: Callable[[messages.Leave | None], None],
    ) -> None:
        self.first_came = asyncio.Event()
        self._opening = opening
        self._on_command, self._on_control, self._on_leave = on_command, on_control, on_leave
        self._clients: list[_Client] = []
        self._in_control: _Client | None = None
        self._serving: set[asyncio.Task[None] | None] = set()
        self._latest: bytes | None = None
        self._over = asyncio.Event()

    @property
    def is_controlled(self) -> bool:
        """Whether somebody is in control."""
        return self._in_control is not None

    async def serve(self, reader: StreamReader, writer: StreamWriter) -> None:
        """One connection, from its beginning to its end; that of another user is refused."""
        process, user = peer_of(writer.get_extra_info("socket"))
        outbox = Outbox(writer)
        serving = asyncio.current_task()
        self._serving.add(serving)
        try:
            if user == os.getuid():
                await self._serve_client(reader, _Client(f"{user_name()}, process {process}", outbox))
        finally:
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()
            self._serving.discard(serving)

    async def _serve_client(self, reader: StreamReader, client: _Client) -> None:
        self._enter(client)
        delivering = asyncio.ensure_future(client.outbox.deliver())
        listening = asyncio.ensure_future(self._listen(reader, client))
        try:
            await asyncio.wait([delivering, listening], return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._exit(client)
            listening.cancel()
            await self._end(client, delivering)

    def send(self, message: messages.HostMessage) -> None:
        """Send a message to all clients."""
        line = messages.message_line(message)
        for client in self._clients:
            client.outbox.put(line)

    def send_latest(self, message: messages.HostMessage) -> None:
        """Send it to all clients who have received everything else; the others get a later one."""
        self._latest = messages.message_line(message)
        for client in self._clients:
            client.outbox.offer(self._latest)

    async def dismiss(self) -> None:
        """Send all clients what waits for them, and let them go."""
        self._over.set()
        for client in self._clients:
            client.outbox.close()
        if serving := [task for task in self._serving if task is not None]:
            await asyncio.wait(serving)

    def _enter(self, client: _Client) -> None:
        for line in self._opening():
            client.outbox.put(line)
        if self._latest is not None:
            client.outbox.offer(self._latest)
        self._clients.append(client)
        if self._in_control is None:
            self._give_control(client)
        else:
            self._send_control(client)
        self.first_came.set()

    def _exit(self, client: _Client) -> None:
        if client in self._clients:
            self._clients.remove(client)
        if client is not self._in_control:
            return
        self._in_control = None
        for other in self._clients:
            self._send_control(other)
        self._on_leave(client.leave)

    async def _end(self, client: _Client, delivering: asyncio.Task[None]) -> None:
        client.outbox.close()
        if client.leave is not None:
            delivering.cancel()
            if not client.leave.keep_running:  # the end of the connection says that nothing is left
                await self._over.wait()
        with suppress(OSError, asyncio.CancelledError):
            await delivering

    async def _listen(self, reader: StreamReader, client: _Client) -> None:
        """Take what the client says, until it leaves or is gone."""
        with suppress(OSError, ValueError):  # one line was longer than any message
            while (line := await reader.readline()).endswith(b"\n"):
                try:
                    self._take(line, client)
                except HexacellError as refusal:
                    failure = messages.HostFailed(problem=refusal.problem, action=refusal.action or "")
                    client.outbox.put(messages.message_line(failure))
                if client.leave is not None:
                    return

    def _take(self, line: bytes, client: _Client) -> None:
        match messages.client_message(line):
            case messages.GiveCommand(command=command):
                if client is not self._in_control:
                    problem = f"{type(command).__name__}: {self._who or 'nobody'} is in control of this run"
                    raise UsageError(problem, action="Take control first")
                self._on_command(command)
            case messages.TakeControl():
                self._give_control(client)
            case messages.Leave() as leave:
                client.leave = leave

    @property
    def _who(self) -> str:
        return "" if self._in_control is None else self._in_control.who

    def _give_control(self, client: _Client) -> None:
        self._in_control = client
        for one in self._clients:
            self._send_control(one)
        self._on_control()

    def _send_control(self, client: _Client) -> None:
        changed = messages.ControlChanged(is_in_control=client is self._in_control, who=self._who)
        client.outbox.put(messages.message_line(changed))
