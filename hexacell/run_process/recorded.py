"""A recorded run, watched again: a connection with a cursor in time."""

import asyncio
from collections.abc import AsyncIterator, Sequence

from hexacell.clock import CellClock
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.pose import Pose
from hexacell.run_process import messages as protocol
from hexacell.runs.run_folder import RunFolder
from procedures.engine.command_loop import Status
from procedures.engine.commands import Command
from procedures.journal.journal import Entry, read_entries
from procedures.run.questions import ask_placement
from procedures.run.state import fold
from procedures.steps import events
from procedures.steps.place import Place

LONGEST_WAIT_S = 60.0
"""Longest wait between two events, s of recorded time: nobody waits for a run resumed the next day."""


class RecordedRun:
    """A :class:`~hexacell.run_process.client.RunConnection` that sends a journal up to its cursor.

    Questions are sent where the journal shows that they were asked: those to place gauges. A run that still
    goes on is shown as far as it was. The cursor stands at the end at first.

    Raises:
        FileError: the journal cannot be read, or is empty.
    """

    def __init__(self, folder: RunFolder, clock: CellClock | None = None) -> None:
        self._folder = folder
        self._entries: Sequence[Entry] = read_entries(folder.journal)
        if not self._entries or not isinstance(self._entries[0].event, events.RunStarted):
            raise FileError("the journal is empty", subject=folder.journal, action="Choose another run")
        self._started = self._entries[0].event
        self._clock = clock or CellClock()
        self.last, self.sequence, self._speed = len(self._entries), 0, 0.0
        self._moved = asyncio.Event()
        self._is_left = False
        self.jump(self.last)

    def step(self, count: int = 1) -> None:
        """Advance by a number of events, or go back if it is negative; stops at both ends."""
        self.jump(self.sequence + count)

    def jump(self, sequence: int) -> None:
        """Go to a line of the journal; stops at both ends."""
        self.sequence = min(max(sequence, 1), self.last)
        self._moved.set()

    def set_speed(self, speed: float) -> None:
        """Advance by itself, ``speed`` times as fast as recorded; 0 stops there."""
        self._speed = speed
        self._moved.set()

    async def messages(self) -> AsyncIterator[protocol.HostMessage]:
        """The run up to the cursor; going back sends it anew."""
        sent = 0
        while not self._is_left:
            self._moved.clear()
            if sent == 0 or sent > self.sequence:
                sent = 0
                yield protocol.RunDescribed(
                    cell=self._started.cell,
                    cell_file=self._folder.cell_file,
                    folder=self._folder.path,
                    mode=self._started.mode,
                    expected_records=fold(entry.event for entry in self._entries).completed,
                    is_recorded=True,
                )
            while sent < self.sequence and not self._is_left:
                sent += 1
                entry = self._entries[sent - 1]
                yield protocol.EventRecorded(sequence=sent, at=entry.at, event=entry.event)
            for message in self._present(sent):
                yield message
            advancing = asyncio.ensure_future(self._advance(sent))
            try:
                await self._moved.wait()
            finally:
                advancing.cancel()

    async def give(self, command: Command) -> None:
        """Refused: raises ``UsageError``."""
        problem = f"{type(command).__name__}: this run is recorded and takes no commands"
        raise UsageError(problem, action="Go on in time, or leave it")

    async def take_control(self) -> None:
        """Refused: raises ``UsageError``."""
        raise UsageError(
            "this run is recorded; nobody is in control of it", action="Go on in time, or leave it"
        )

    async def leave(self, *, keep_running: bool) -> None:  # noqa: ARG002 - nothing runs
        """End the messages."""
        self._is_left = True
        self._moved.set()

    def _present(self, sequence: int) -> list[protocol.HostMessage]:
        """What else a run sends: its status, its question, and where the cursor is."""
        entry = self._entries[sequence - 1]
        at_cursor = protocol.CursorMoved(sequence=sequence, last=self.last, at=entry.at, speed=self._speed)
        status, question = Status.RUNNING, None
        match entry.event:
            case events.Ended() | events.Interrupted():
                status = Status.ENDED
            case events.Paused():
                status = Status.PAUSED
            case events.StepBegun(step=Place(at=at, pose=pose)):
                status, question = Status.AWAITING_OPERATOR, ask_placement(at, Pose(*pose))
        asked = protocol.QuestionChanged(question=question)
        return [protocol.StatusChanged(status=status), asked, at_cursor]

    async def _advance(self, sent: int) -> None:
        if self._speed and sent < self.last:
            here, following = self._entries[sent - 1], self._entries[sent]
            elapsed = following.monotonic_s - here.monotonic_s
            if elapsed < 0.0:  # the machine was restarted
                elapsed = (following.at - here.at).total_seconds()
            await self._clock.sleep(min(max(elapsed, 0.0), LONGEST_WAIT_S) / self._speed)
            if self.sequence == sent:
                self.jump(sent + 1)
