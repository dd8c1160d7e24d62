"""The process of a program that was started: its streams, what it prints, how it ends."""

import asyncio
import logging
import os
import signal
from asyncio.subprocess import PIPE, Process
from collections import deque
from contextlib import suppress
from typing import Self

from drivers.controllers.adapter.masking import Masking
from drivers.controllers.adapter.options import Program
from drivers.controllers.reload_command import path_with_own_programs
from hexacell.printable import printable

_log = logging.getLogger("drivers.controllers.adapter")

_CHUNK = 65_536
_LONGEST_SHOWN = 400
_LAST_LINES = 3
_MOST_LOGGED = 1000
"""Lines of a program's stderr that are in the log; a program may print without end."""

_EXIT_S = 1.0
"""How long a program that has closed its output is waited for, s."""


class ProgramProcess:
    """A running program.

    Attributes:
        stdin: where requests are written, and ``stdout`` where answers are read.
    """

    def __init__(self, program: Program, process: Process, masked: Masking) -> None:
        assert process.stdin and process.stdout and process.stderr  # noqa: S101, PT018 - pipes
        self.stdin, self.stdout = process.stdin, process.stdout
        self._name, self._process, self._masked = program.name, process, masked
        self._said: deque[str] = deque(maxlen=_LAST_LINES)
        self._lines_said = 0
        self._listening = asyncio.create_task(self._read_stderr(process.stderr))

    @classmethod
    async def start(cls, program: Program, masked: Masking, longest_line: int) -> Self:
        """Start it; a Ctrl+C in this terminal must not end it while the robot moves. Raises ``OSError``."""
        process = await asyncio.create_subprocess_exec(
            *program.command,
            stdin=PIPE,
            stdout=PIPE,
            stderr=PIPE,
            limit=longest_line,
            start_new_session=True,
            env=os.environ | {"PATH": path_with_own_programs()},
        )
        return cls(program, process, masked)

    async def ending(self) -> str:
        """How it ended, in words, with the last lines that it printed."""
        with suppress(TimeoutError):
            async with asyncio.timeout(_EXIT_S):
                await self._process.wait()
                await asyncio.wait([self._listening])
        status = self._process.returncode
        how = "closed its output" if status is None else f"ended with exit status {status}"
        if status is not None and status < 0:
            how = f"was ended by signal {-status}"
        return ": ".join((how, *self._said))

    async def close(self, limit_s: float) -> None:
        """Wait for its end, its stdin being closed; if it does not end in time it is killed."""
        try:
            async with asyncio.timeout(limit_s):
                await self._process.wait()
        except TimeoutError:
            _log.warning("%s: did not end with its stdin, and was killed", self._name)
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            with suppress(TimeoutError):  # what it has started elsewhere may hold its pipes open
                async with asyncio.timeout(limit_s):
                    await self._process.wait()
        self._listening.cancel()
        await asyncio.gather(self._listening, return_exceptions=True)

    async def _read_stderr(self, stream: asyncio.StreamReader) -> None:
        rest = b""
        while data := await stream.read(_CHUNK):
            *lines, rest = (rest + data).split(b"\n")
            rest = rest[:_LONGEST_SHOWN]
            for line in lines:
                self._say(line)
        self._say(rest)

    def _say(self, line: bytes) -> None:
        if not (text := self._masked(line[:_LONGEST_SHOWN].decode("utf-8", "replace")).strip()):
            return
        self._said.append(printable(text))
        self._lines_said += 1
        if self._lines_said <= _MOST_LOGGED:
            _log.info("%s: %s", self._name, self._said[-1])
        elif self._lines_said == _MOST_LOGGED + 1:
            _log.warning("%s: prints more, which is not in the log", self._name)
