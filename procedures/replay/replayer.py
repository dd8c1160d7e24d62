"""Replay of a journal: every decision and every outcome is computed again and compared.

Each is computed from the recorded state before it, so that one difference does not cause others.
A step states which events are its outcomes; all other events have external causes (a person, a fault, a
policy) and are taken from the journal.
"""

import asyncio
import math
from collections.abc import Awaitable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import BaseModel

from drivers.encoders.bank import joint_variables
from hexacell import __version__
from hexacell.cell.devices import EncoderSettings
from hexacell.config.change import ConfigChange
from hexacell.errors import ExitCode, HexacellError
from procedures.devices.settling import trimmed_mean
from procedures.engine.engine import Engine
from procedures.journal.journal import Entry, Journal, encode
from procedures.replay.recorded_executor import TOLERANCE, RecordedStepExecutor
from procedures.run.readings import Reading
from procedures.run.state import RunState, apply
from procedures.steps import events
from procedures.steps.events import Event, Step

WORDING_FIELDS = frozenset({"sentence", "line", "reason"})
"""Text fields; a later version may word them differently."""

SEARCHED_FIELDS = frozenset({"design"})
"""Fields found by a search that rounding may end elsewhere; nothing is decided by them."""

Outcome = TypeVar("Outcome")


class Aspect(StrEnum):
    """The kind of a difference."""

    DECISION = "decision"
    RESULT = "result"
    WORDS = "words"


@dataclass(frozen=True, slots=True)
class Change:
    """One field that differs; ``field`` is empty where the events cannot be compared."""

    field: str
    recorded: object
    replayed: object


@dataclass(frozen=True, slots=True)
class Difference:
    """A change, with the line of the journal and the step or kind of event."""

    line: int
    place: str
    aspect: Aspect
    change: Change

    def __str__(self) -> str:
        field = f"{self.change.field}: " if self.change.field else ""
        return (
            f"line {self.line}, {self.place}: {field}recorded {_short(self.change.recorded)}, "
            f"replayed {_short(self.change.replayed)}"
        )


@dataclass
class ReplayReport:
    """A run that is replayed, by which software it was recorded, and the findings so far.

    ``events`` is how many its journal has, ``decisions`` and ``results`` are how many of these were
    computed again, ``taken`` is how many other events were taken from the journal. ``change`` is the change
    of the config that was proposed again, if any.
    """

    journal: Path
    recorded_by: str
    events: int
    replayed_by: str = f"hexacell {__version__}"
    decisions: int = 0
    results: int = 0
    taken: int = 0
    differences: list[Difference] = field(default_factory=list)
    change: ConfigChange | None = None

    @property
    def is_same_software(self) -> bool:
        """Whether decisions must be the same; another version may decide better."""
        return self.recorded_by == self.replayed_by

    @property
    def is_same(self) -> bool:
        """Whether no difference counts."""
        return not any(self.counts(difference) for difference in self.differences)

    def counts(self, difference: Difference) -> bool:
        """Whether a difference means that the replay failed; see ``docs/interface.md``."""
        if difference.aspect is Aspect.DECISION:
            return self.is_same_software
        return difference.aspect is Aspect.RESULT


def changes(recorded: BaseModel, replayed: BaseModel, tolerance: float) -> list[Change]:
    """The differences in the recorded fields; later versions may have more fields."""
    stated = recorded.model_dump(mode="json", exclude_unset=True)
    return list(_changes("", stated, replayed.model_dump(mode="json"), tolerance))


def is_wording(change: Change) -> bool:
    """Whether only the wording differs, or what nothing is decided by."""
    fields = change.field.split(".")
    return fields[-1] in WORDING_FIELDS or fields[0] in SEARCHED_FIELDS


def counts_mismatch(reading: Reading, encoders: EncoderSettings) -> Change | None:
    """A difference of joint variables from their encoder counts by more than half a count."""
    mean = trimmed_mean(np.array([joint_variables(counts, encoders) for counts in reading.counts]))
    if np.abs(mean - reading.joints).max() <= 0.5 * encoders.step + TOLERANCE:
        return None
    return Change("reading.joints", reading.joints, tuple(mean.tolist()))


def _changes(field: str, recorded: object, replayed: object, tolerance: float) -> Iterator[Change]:
    match recorded, replayed:
        case Mapping(), Mapping():
            for key, value in recorded.items():
                name = f"{field}.{key}" if field else str(key)
                yield from _changes(name, value, replayed.get(key), tolerance)
        case list(), list() if len(recorded) == len(replayed):
            for place, (first, second) in enumerate(zip(recorded, replayed, strict=True)):
                yield from _changes(f"{field}[{place}]", first, second, tolerance)
        case _:
            is_same = recorded == replayed
            if isinstance(recorded, float) and isinstance(replayed, int | float):
                both_nan = math.isnan(recorded) and math.isnan(replayed)
                is_close = math.isclose(recorded, replayed, rel_tol=tolerance, abs_tol=tolerance)
                is_same = both_nan or is_close
            if not is_same:
                yield Change(field, recorded, replayed)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


CANCELLING = (events.PoseExcluded, events.Interrupted, events.Failed, events.Paused)
"""Events that end a step without an outcome that a replay computes again."""


class Scope(StrEnum):
    """What is computed again."""

    ALL = "all"
    DECISIONS = "decisions"
    RESULTS = "results"
    IDENTIFICATION = "identification"

    @property
    def decides(self) -> bool:
        """Whether decisions are computed again."""
        return self in {Scope.ALL, Scope.DECISIONS}

    def derives(self, step: Step) -> bool:
        """Whether the outcome of this step is computed again."""
        return self in {Scope.ALL, Scope.RESULTS} or (
            self is Scope.IDENTIFICATION and step.kind == "identify"
        )


@dataclass(eq=False)
class Replayer:
    """Replays one recorded run in a temporary folder; ``report`` gets the findings."""

    executor: RecordedStepExecutor
    report: ReplayReport
    scope: Scope = Scope.ALL
    tolerance: float = TOLERANCE
    _state: RunState = field(default_factory=RunState)
    _current_step: Step | None = None
    _line: int = 0

    async def replay(self, entries: Sequence[Entry]) -> None:
        """Replay all entries."""
        for place, entry in enumerate(entries):
            self._line = entry.number
            await self._compare(entry.event, entries[:place])
            self._state = apply(self._state, entry.event)

    async def _compare(self, event: events.Event, before: Sequence[Entry]) -> None:
        match event:
            case events.StepBegun():
                if self.scope.decides:
                    self.report.decisions += 1
                    self._compare_with(Aspect.DECISION, event.step.key, event.step, await self._decided())
                self._current_step = event.step
                return
            case events.Interrupted():
                await self._interruption(event)
            case events.Ended():
                await self._end(event, before)
            case _ if self._current_step is not None and is_outcome(self._current_step, event):
                await self._outcome(self._current_step, event)
                self._current_step = None
            case _:
                self.report.taken += 1
        if isinstance(event, CANCELLING):
            self._current_step = None

    async def _decided(self) -> Step | Exception | None:
        return await _result_or_error(asyncio.to_thread(self.executor.next_step, self._state))

    async def _outcome(self, step: Step, event: events.Event) -> None:
        if not self.scope.derives(step):
            return
        self.report.results += 1
        self.executor.recorded.outcome = event
        derived = await _result_or_error(self.executor.perform(step, self._state))
        self._compare_with(Aspect.RESULT, step.key, event, derived)
        encoders = self.executor.cell.settings.encoders
        if isinstance(event, events.RecordTaken) and (change := counts_mismatch(event.reading, encoders)):
            self._add_difference(Aspect.RESULT, step.key, change)

    async def _interruption(self, event: events.Interrupted) -> None:
        """A failure without a device or the disk is computed again; any other is taken from the journal."""
        is_computed, step = event.exit_code == ExitCode.OUT_OF_LIMITS, self._current_step
        if is_computed and step is None and self.scope.decides:  # of a decision, or between two steps
            decided = await self._decided()
            if isinstance(decided, Exception):
                self.report.decisions += 1
                self._compare_with(Aspect.DECISION, "deciding", event, decided)
                return
        if is_computed and step is not None and step.is_reproducible and self.scope.derives(step):
            await self._outcome(step, event)
        else:
            self.report.taken += 1

    async def _end(self, event: events.Ended, before: Sequence[Entry]) -> None:
        """The engine must find no next step and end the run with the same event."""
        if self.scope is not Scope.ALL:
            self.report.taken += 1
            return
        self.report.results += 1
        left = await self._decided()
        if left is not None:
            self._compare_with(Aspect.DECISION, "end", event, left)
            return
        path = self.executor.folder.journal
        path.write_bytes(b"".join(encode(entry) for entry in before))
        with Journal(path) as journal:
            ended = await _result_or_error(Engine(self.executor, journal).run())
        self._compare_with(Aspect.RESULT, "end", event, ended)

    def _compare_with(self, aspect: Aspect, place: str, recorded: BaseModel, found: object) -> None:
        if isinstance(recorded, events.Interrupted) and isinstance(found, Exception):
            if str(found) != recorded.reason:
                self._add_difference(Aspect.WORDS, place, Change("reason", recorded.reason, str(found)))
            return
        if type(found) is not type(recorded) or not isinstance(found, BaseModel):
            self._add_difference(aspect, place, Change("", _describe(recorded), _describe(found)))
            return
        for change in changes(recorded, found, self.tolerance):
            self._add_difference(Aspect.WORDS if is_wording(change) else aspect, place, change)

    def _add_difference(self, aspect: Aspect, place: str, change: Change) -> None:
        self.report.differences.append(Difference(self._line, place, aspect, change))


async def _result_or_error(work: Awaitable[Outcome]) -> Outcome | Exception:
    """The result or the error; a programming error too, since bug reports are about those."""
    try:
        return await work
    except Exception as error:
        return error


def _describe(found: object) -> str:
    """A short description of an event, a step or a failure."""
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


def is_outcome(step: Step, event: Event) -> bool:
    """Whether an event is the outcome of a step, with all of its inputs."""
    if isinstance(event, CANCELLING) or (
        isinstance(event, events.SetInvalidated) and event.reading is None
    ):
        return False
    return isinstance(event, step.outcomes)
