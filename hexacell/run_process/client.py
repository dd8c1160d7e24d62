"""A connection to a run, in another process or recorded, and how such a process is started."""

import asyncio
import os
import subprocess
import tempfile
from asyncio import StreamReader, StreamWriter
from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import DEVNULL, PIPE
from typing import BinaryIO, Protocol

from hexacell.cell.loader import Cell
from hexacell.errors import ExitCode, FileError, HexacellError
from hexacell.python_process import python_command
from hexacell.run_process import messages as protocol
from hexacell.run_process.run_socket import peer_of, socket_path
from hexacell.runs.run_folder import RunFolder, new_run
from hexacell.services.history.resumption import LATEST, run_to_resume
from hexacell.storage.atomic_files import read_end
from procedures.calibration.calibration import Mode
from procedures.engine.commands import Command
from procedures.journal.journal import read_journal
from procedures.steps import events

READY = b"ready\n"
"""What a host writes to its stdout when it listens; else it writes why it does not, as a message."""

STOP_S = 0.4
"""How long leaving waits for the end of a run that is to be stopped, s."""

LET_GO_S = 5.0
"""How long leaving waits until the run has heard that it is to go on, s. Whoever hangs up before may be
taken for lost, because what is still unread goes with the connection, and the run pauses."""

LOST = protocol.HostFailed(
    problem="the connection to the run is lost: its process was killed, or let this terminal go",
    action="Look at the robot, whose last move may go on. What was measured is kept: leave, come back, and "
    "where no run is shown then, press r in 2 Preflight, which resumes it",
    exit_code=int(ExitCode.HARDWARE),
)


class RunConnection(Protocol):
    """What a screen needs of a run.

    ``give``, ``take_control`` and ``leave`` return when the message is sent; what it causes comes as a
    message. All raise ``HexacellError`` where the run cannot be reached any more.
    """

    def messages(self) -> AsyncIterator[protocol.HostMessage]:
        """Everything that the run sends; ends when it is over. To be called once."""
        ...

    async def give(self, command: Command) -> None:
        """Give the engine a command. Refused with ``HostFailed`` where another client is in control."""
        ...

    async def take_control(self) -> None:
        """Become the one who gives commands, which ``ControlChanged`` confirms."""
        ...

    async def leave(self, *, keep_running: bool) -> None:
        """Let the run go on without anybody, or have it stopped after its step; ends the messages."""
        ...


class RunFailed(HexacellError):
    """A run could not begin, or ended early; the exit code is that of the reason."""

    def __init__(self, failure: protocol.HostFailed) -> None:
        super().__init__(failure.problem, action=failure.action or None)
        self.exit_code = ExitCode(failure.exit_code or ExitCode.FAULT)


class HostConnection:
    """A :class:`~hexacell.run_process.client.RunConnection` over a socket."""

    def __init__(self, reader: StreamReader, writer: StreamWriter) -> None:
        self._reader = reader
        self._writer = writer
        self._is_left = False
        self._goes_on_alone = False

    async def messages(self) -> AsyncGenerator[protocol.HostMessage, None]:
        """Everything that the run sends; a connection that is lost ends with a failure."""
        has_ended = False
        with suppress(ConnectionError):
            while (line := await self._reader.readline()).endswith(b"\n"):
                if self._goes_on_alone:  # what it still says was on its way
                    continue
                message = protocol.host_message(line)
                match message:
                    case protocol.EventRecorded(event=events.Ended() | events.Interrupted()):
                        has_ended = True
                    case protocol.HostFailed(exit_code=int()):
                        has_ended = True
                yield message
        self._writer.close()
        if not has_ended and not self._is_left:
            yield LOST

    async def give(self, command: Command) -> None:
        """Give the engine a command."""
        await self._send(protocol.GiveCommand(command=command))

    async def take_control(self) -> None:
        """Become the one who gives commands."""
        await self._send(protocol.TakeControl())

    async def leave(self, *, keep_running: bool) -> None:
        """Leave the run, which hangs up when it has heard that, or when it has ended."""
        self._is_left, self._goes_on_alone = True, keep_running
        with suppress(HexacellError, TimeoutError):
            await self._send(protocol.Leave(keep_running=keep_running))
            async with asyncio.timeout(LET_GO_S if keep_running else STOP_S):
                # A stream tells its end to its only reader, and somebody else may be that.
                while not self._reader.at_eof():  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
        self._writer.close()

    async def _send(self, message: protocol.ClientMessage) -> None:
        try:
            self._writer.write(protocol.message_line(message))
            await self._writer.drain()
        except OSError as error:
            raise FileError(
                "the run cannot be reached any more", action="Look at it with `hexacell history`"
            ) from error


async def connect_to_run(path: Path) -> HostConnection | None:
    """A connection to the run whose socket is there; None if there is no run.

    Raises:
        FileError: it is another user's.
    """
    try:
        reader, writer = await asyncio.open_unix_connection(str(path), limit=protocol.LONGEST_MESSAGE)
    except OSError:
        return None
    _, user = peer_of(writer.get_extra_info("socket"))
    if user != os.getuid():
        writer.transport.abort()
        raise FileError("this run is another user's", subject=path, action="Remove the socket")
    return HostConnection(reader, writer)


async def begin_run(cell: Cell, mode: Mode, *, length_check: bool = False) -> HostConnection:
    """Begin a run in a process of its own; raises ``HexacellError``."""
    return await _start(cell, new_run(cell), mode.value, ["--length-check"] if length_check else [])


async def resume_run(cell: Cell, named: str = LATEST) -> HostConnection:
    """Resume an interrupted run, the latest by default, in a process; raises ``HexacellError``."""
    folder = run_to_resume(cell, named)
    started = next(iter(read_journal(folder.journal)), None)
    mode = started.mode if isinstance(started, events.RunStarted) else Mode.OPTIMISE.value
    return await _start(cell, folder, mode, ["--resume"])


async def _start(cell: Cell, folder: RunFolder, mode: str, more: Sequence[str]) -> HostConnection:
    arguments = [str(cell.path), "--mode", mode, "--folder", str(folder.path), *more]
    return await start_host(socket_path(cell), arguments)


async def start_host(path: Path, arguments: Sequence[str]) -> HostConnection:
    """Start ``hexacell host`` and connect to it at ``path``; raises ``RunFailed``."""
    await asyncio.to_thread(_spawn, arguments)
    connection = await connect_to_run(path)
    if connection is None:
        raise RunFailed(protocol.HostFailed(problem="the run's process ended at once"))
    return connection


def _spawn(arguments: Sequence[str]) -> None:
    """Start the process and wait until it listens; it is no child of this one then."""
    command = python_command("hexacell", "host", *arguments)
    with tempfile.TemporaryFile() as errors:
        answer = subprocess.run(  # noqa: S603 - this program; its stdout ends with the answer
            command, stdin=DEVNULL, stdout=PIPE, stderr=errors, start_new_session=True, check=False
        ).stdout
        if answer != READY:
            raise RunFailed(_failure_in(answer, errors))


def _failure_in(answer: bytes, errors: BinaryIO) -> protocol.HostFailed:
    with suppress(HexacellError):
        message = protocol.host_message(answer)
        if isinstance(message, protocol.HostFailed):
            return message
    words = read_end(errors, 4096).splitlines()
    problem = words[-1] if words else "its process ended without a word"
    return protocol.HostFailed(problem=f"the run could not begin: {problem}", exit_code=int(ExitCode.FAULT))
