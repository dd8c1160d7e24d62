"""Through a journal, event by event: is each decided and derived again as it was?

Every decision and every outcome is made from the recorded state before it, so that one difference
does not make all that follow differ.

Which events of the journal are what came of a step, and which of those can be derived again.
# MERGED-DOC
Whatever is not listed here was caused from outside, by a person, a fault or a policy, and is taken
as it stands.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from hexacell.errors import ExitCode, HexacellError
from procedures.engine.engine import Engine
from procedures.engine.step_executor import StepExecutor
from procedures.journal.journal import Journal
from procedures.journal.line_format import Entry, encode
from procedures.replay.comparison import (
    TOLERANCE,
    Aspect,
    Change,
    Difference,
    changes,
    counts_mismatch,
    is_wording,
)
from procedures.replay.recorded_devices import RecordedOutcome
from procedures.run import events
from procedures.run.events import Event
from procedures.run.state import RunState, apply
from procedures.run.steps import Step

Outcome = TypeVar("Outcome")


class Scope(StrEnum):
    """What is done again."""

    ALL = "all"
    DECISIONS = "decisions"
    RESULTS = "results"
    IDENTIFICATION = "identification"

    @property
    def decides(self) -> bool:
        """Whether decisions are."""
        return self in {Scope.ALL, Scope.DECISIONS}

    def derives(self, step: Step) -> bool:
        """Whether the outcome of this step is."""
        return self in {Scope.ALL, Scope.RESULTS} or (
            self is Scope.IDENTIFICATION and step.kind == "identify"
        )


@dataclass
class ReplayReport:
    """What was found by now.

    Attributes:
        decisions: steps that were decided again.
        results: outcomes that were derived again.
        taken: other events, taken as they stand.
    """

    decisions: int = 0
    results: int = 0
    taken: int = 0
    differences: list[Difference] = field(default_factory=list)


class Replayer:
    """One recorded run and the procedure that it is put through.

    Args:
        performer: with the recorded devices of ``tape``, in a folder where it can do no harm.
        scratch: a journal of its own, for the end of the run.
    """

    def __init__(
        self,
        performer: StepExecutor,
        tape: RecordedOutcome,
        scratch: Path,
        scope: Scope = Scope.ALL,
        tolerance: float = TOLERANCE,
    ) -> None:
        self._performer = performer
        self._tape = tape
        self._scratch = scratch
        self._scope = scope
        self._tolerance = tolerance
        self._state = RunState()
        self._doing: Step | None = None
        self._line = 0
        self.report = ReplayReport()

    async def replay(self, entries: Sequence[Entry]) -> ReplayReport:
        """Go through all of them."""
        for place, entry in enumerate(entries):
            self._line = entry.number
            await self._compare(entry.event, entries[:place])
            self._state = apply(self._state, entry.event)
        return self.report

    async def _compare(self, event: events.Event, before: Sequence[Entry]) -> None:
        match event:
            case events.StepBegun():
                await self._decision(event)
                self._doing = event.step
                return
            case events.Interrupted():
                await self._interruption(event)
            case events.Ended():
                await self._end(event, before)
            case _ if self._doing is not None and is_outcome(self._doing, event):
                await self._outcome(self._doing, event)
                self._doing = None
            case _:
                self.report.taken += 1
        if event.kind in CANCELLED:
            self._doing = None

    async def _decision(self, event: events.StepBegun) -> None:
        if not self._scope.decides:
            return
        self.report.decisions += 1
        decided = await self._decided()
        self._note(Aspect.DECISION, event.step.key, event.step, decided)

    async def _decided(self) -> Step | Exception | None:
        deciding = asyncio.to_thread(self._performer.calibration.next_step, self._state)
        return await _or_error(deciding)

    async def _outcome(self, step: Step, event: events.Event) -> None:
        if not self._scope.derives(step):
            return
        self.report.results += 1
        derived = await self._performed(step, event)
        self._note(Aspect.RESULT, step.key, event, derived)
        if isinstance(event, events.RecordTaken):
            encoders = self._performer.cell.settings.encoders
            if change := counts_mismatch(event.reading, encoders):
                self._differ(Aspect.RESULT, step.key, change)

    async def _performed(self, step: Step, outcome: events.Event) -> events.Event | Exception:
        self._tape.load(outcome)
        return await _or_error(self._performer.perform(step, self._state))

    async def _interruption(self, event: events.Interrupted) -> None:
        """A failure that needs no device and no disk comes again; any other is taken as it stands."""
        if event.exit_code != ExitCode.OUT_OF_LIMITS:
            self.report.taken += 1
        elif self._doing is None:
            await self._undecided(event)
        elif self._doing.kind in COMPUTED_STEPS and self._scope.derives(self._doing):
            self.report.results += 1
            derived = await self._performed(self._doing, event)
            self._note(Aspect.RESULT, self._doing.key, event, derived)
        else:
            self.report.taken += 1

    async def _undecided(self, event: events.Interrupted) -> None:
        """Deciding itself may have failed, or something between two steps."""
        decided = await self._decided() if self._scope.decides else None
        if isinstance(decided, Exception):
            self.report.decisions += 1
            self._note(Aspect.DECISION, "deciding", event, decided)
        else:
            self.report.taken += 1

    async def _end(self, event: events.Ended, before: Sequence[Entry]) -> None:
        """The real engine finds nothing left to do and ends the run likewise."""
        if self._scope is not Scope.ALL:
            self.report.taken += 1
            return
        self.report.results += 1
        left = await self._decided()
        if left is not None:
            self._note(Aspect.DECISION, "end", event, left)
            return
        self._scratch.write_bytes(b"".join(encode(entry) for entry in before))
        with Journal(self._scratch) as journal:
            ended = await _or_error(Engine(self._performer, journal).run())
        self._note(Aspect.RESULT, "end", event, ended)

    def _note(self, aspect: Aspect, place: str, recorded: BaseModel, found: object) -> None:
        if isinstance(recorded, events.Interrupted) and isinstance(found, Exception):
            if str(found) != recorded.reason:
                self._differ(Aspect.WORDS, place, Change("reason", recorded.reason, str(found)))
            return
        if type(found) is not type(recorded) or not isinstance(found, BaseModel):
            self._differ(aspect, place, Change("", _in_words(recorded), _in_words(found)))
            return
        for change in changes(recorded, found, self._tolerance):
            self._differ(Aspect.WORDS if is_wording(change) else aspect, place, change)

    def _differ(self, aspect: Aspect, place: str, change: Change) -> None:
        self.report.differences.append(Difference(self._line, place, aspect, change))


async def _or_error(work: Awaitable[Outcome]) -> Outcome | Exception:
    """What it gives, or how it fails: an error of the program is what a bug report is about."""
    try:
        return await work
    except Exception as error:
        return error


def _in_words(found: object) -> str:
    """What an event, a step or a failure is, in a few words."""
    match found:
        case None:
            return "nothing left to do"
        case events.Interrupted():
            return f"stopped: {found.reason}"
        case HexacellError():
            return f"stopped: {found}"
        case Exception():
            return f"failed: {found!r}"
        case _:
            return str(getattr(found, "key", getattr(found, "kind", found)))


OUTCOME_KINDS: dict[str, frozenset[str]] = {
    "locate": frozenset({"located"}),
    "move": frozenset({"arrived"}),
    "place": frozenset({"placed"}),
    "sample": frozenset({"sampled", "refused"}),
    "revisit": frozenset({"confirmed", "voided"}),
    "close": frozenset({"closed"}),
    "lend": frozenset({"lent"}),
    "take back": frozenset({"taken back"}),
    "identify": frozenset({"identified"}),
    "propose": frozenset({"proposed"}),
    "commit": frozenset({"committed"}),
    "judge": frozenset({"judged"}),
    "roll back": frozenset({"rolled back"}),
}
"""Kinds of events by the kind of step."""

MEASURED_KINDS = frozenset({"confirmed", "voided", "closed"})
"""Kinds that can be derived again only from the reading that they hold; version 1 kept none."""

CANCELLED = frozenset({"interrupted", "failed", "paused"})
"""After these the step that was being done is over without an outcome."""

COMPUTED_STEPS = frozenset({"lend", "take back", "identify", "propose", "commit", "judge"})
"""Steps whose failure follows from what is recorded, unless it came from a device or the disk."""


def is_outcome(step: Step, event: Event) -> bool:
    """Whether an event is what came of a step, with all that it was made from."""
    is_whole = event.kind not in MEASURED_KINDS or getattr(event, "reading", None) is not None
    return is_whole and event.kind in OUTCOME_KINDS.get(step.kind, ())
