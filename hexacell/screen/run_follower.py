"""The run that a screen follows: one at a time."""

import asyncio
from collections.abc import Callable

from hexacell.errors import HexacellError, UsageError
from hexacell.run_process.client import RunConnection
from hexacell.run_process.messages import HostFailed, HostMessage, StatusChanged
from hexacell.text.screens.run_picture import RunPicture, picture_after
from procedures.engine.command_loop import Status
from procedures.engine.commands import Command
from procedures.run.cancellation import cancel_and_wait

FEW_MESSAGES = 50
"""After so many at once, as on attaching, the screen is drawn before the next."""


class RunFollower:
    """A run as a screen sees it; ``on_end`` is called when it has sent everything, ``on_change`` meanwhile.

    Attributes:
        connection: the run that is followed; None when it is over.
        picture: what is known of it; stays when the run is over.
        questions: number of questions opened, so that none is taken for another.
        runs: number of runs followed.
    """

    def __init__(
        self, now: Callable[[], float], on_end: Callable[[], None], on_change: Callable[[], None]
    ) -> None:
        self.picture = RunPicture()
        self.questions = 0
        self.runs = 0
        self._now, self._on_end, self._on_change = now, on_end, on_change
        self._is_left = False
        self.connection: RunConnection | None = None
        self._following: asyncio.Task[None] | None = None

    async def follow(self, connection: RunConnection) -> None:
        """Follow another run."""
        await self.stop()
        self.picture, self.connection = RunPicture(), connection
        self.runs += 1
        self._following = asyncio.create_task(self._follow(connection))

    async def stop(self) -> None:
        """Follow no run any more, without a word to it."""
        following, self._following, self.connection = self._following, None, None
        if following is not None:
            await cancel_and_wait(following)

    async def give(self, command: Command) -> None:
        """Give a command; raises ``HexacellError``."""
        if self.connection is None:
            raise UsageError("no run goes on here", action="Start one from 2 Preflight")
        await self.connection.give(command)

    async def leave(self, *, keep_running: bool) -> None:
        """Let the run go on alone, or have it stopped; raises ``HexacellError``."""
        if self.connection is not None:
            self._is_left = True
            await self.connection.leave(keep_running=keep_running)

    async def _follow(self, connection: RunConnection) -> None:
        try:
            count = 0
            async for message in connection.messages():
                self._take(message)
                count += 1
                if count % FEW_MESSAGES == 0:
                    await asyncio.sleep(0)
        except HexacellError as error:
            self._take(HostFailed(problem=str(error), action=error.action or ""))
        finally:
            if self.connection is connection:
                self.connection = None
        self._on_change()
        if self._is_left:
            return
        if self.picture.status is not Status.ENDED and not self.picture.is_recorded:
            self._take(StatusChanged(status=Status.ENDED))
        self._on_end()

    def _take(self, message: HostMessage) -> None:
        question = self.picture.question
        self.picture = picture_after(self.picture, message, self._now())
        if self.picture.question not in {None, question}:
            self.questions += 1
        self._on_change()
