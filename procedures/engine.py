"""The engine: decide, write down, do, write down, until there is nothing left to do."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress

from hexacell.errors import ExitCode, HexacellError, SeveralErrors
from hexacell.verification import Verdict
from procedures import events
from procedures.journal import Journal
from procedures.performing import Performer
from procedures.state import RunState, apply, fold
from procedures.steps import Step
from procedures.uninterrupted import uninterrupted

Listener = Callable[[events.Event, RunState], None]

_KILLED = int(ExitCode.INTERRUPTED)


class Engine:
    """One run, from where its journal stands to its end.

    Faces learn everything through listeners, which are called after each event is on the disk.
    """

    def __init__(self, performer: Performer, journal: Journal, listeners: Sequence[Listener] = ()) -> None:
        self._performer = performer
        self._journal = journal
        self._listeners = tuple(listeners)
        self.state = fold(journal.events)

    async def run(self) -> events.Ended:
        """Do all that is left.

        Whatever stops it, motion stops in place and the journal says so before the error goes on.

        Raises:
            HexacellError: a step could not be done.
        """
        try:
            await self._performer.devices.controller.prepare()
            while (step := await self._next()) is not None:
                self.tell(events.StepBegun(step=step))
                self.tell(await self._performer.perform(step, self.state))
        except BaseException as error:
            await self._stop(error)
            raise
        return self._end()

    def void_open_sets(self) -> None:
        """Give up what an interruption left open: nobody saw whether gauges kept their zero.

        A run that ended without a word, by a kill or a power cut, left the robot nobody knows where.
        """
        if self.state.standing is not None:
            self.tell(events.Interrupted(reason="the program ended without a word", exit_code=_KILLED))
        for key, measured in list(self.state.sets.items()):
            if not measured.closed:
                self.tell(events.SetVoided(at=key, reason="the run was interrupted in this set"))

    def tell(self, event: events.Event) -> None:
        """Write an event down, then let everybody know."""
        self._journal.append(event)
        self.state = apply(self.state, event)
        for listener in self._listeners:
            listener(event, self.state)

    async def _next(self) -> Step | None:
        return await asyncio.to_thread(self._performer.calibration.next_step, self.state)

    async def _stop(self, error: BaseException) -> None:
        reason = str(error) or type(error).__name__
        try:
            with suppress(HexacellError):
                await uninterrupted(self._performer.devices.controller.stop())
        finally:
            with suppress(HexacellError):
                self.tell(events.Interrupted(reason=reason, exit_code=int(_exit_code(error))))

    def _end(self) -> events.Ended:
        if self.state.ended is not None:
            return self.state.ended
        judged = self.state.judged
        passed = judged is not None and judged.verdict is Verdict.PASS
        code = ExitCode.DONE if passed else ExitCode.OUT_OF_LIMITS
        line = judged.line if judged is not None else "nothing was judged"
        if self.state.rolled_back:
            line += "; rolled back, the controller is as it was"
        ended = events.Ended(exit_code=int(code), line=line)
        self.tell(ended)
        return ended


def _exit_code(error: BaseException) -> ExitCode:
    if isinstance(error, SeveralErrors):
        return error.worst
    return error.exit_code if isinstance(error, HexacellError) else ExitCode.INTERRUPTED
