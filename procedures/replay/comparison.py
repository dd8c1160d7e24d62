"""Comparison of recorded and replayed events, field by field, and what a replay found by it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from drivers.encoders.bank import joint_variables
from hexacell import __version__
from hexacell.cell.devices import EncoderSettings
from procedures.devices.settling import trimmed_mean
from procedures.run.readings import Reading

TOLERANCE = 1e-9
"""Largest difference that counts as rounding: absolute in the field's unit, above 1 relative."""

WORDING_FIELDS = frozenset({"sentence", "line", "reason"})
"""Text fields; a later version may word them differently."""

SEARCHED_FIELDS = frozenset({"design"})
"""Fields found by a search that rounding may end elsewhere; nothing is decided by them."""


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
    """A run that is replayed, and the findings so far.

    Attributes:
        recorded_by: the software that recorded it.
        events: how many events its journal has.
        decisions: how many decisions were computed again.
        results: how many outcomes were computed again.
        taken: how many other events were taken from the journal.
    """

    journal: Path
    recorded_by: str
    events: int
    replayed_by: str = f"hexacell {__version__}"
    decisions: int = 0
    results: int = 0
    taken: int = 0
    differences: list[Difference] = field(default_factory=list)

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
        match difference.aspect:
            case Aspect.WORDS:
                return False
            case Aspect.DECISION:
                return self.is_same_software
            case Aspect.RESULT:
                return True


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
            if not _same(recorded, replayed, tolerance):
                yield Change(field, recorded, replayed)


def _same(recorded: object, replayed: object, tolerance: float) -> bool:
    if isinstance(recorded, float) and isinstance(replayed, int | float):
        both_nan = math.isnan(recorded) and math.isnan(replayed)
        return both_nan or math.isclose(recorded, replayed, rel_tol=tolerance, abs_tol=tolerance)
    return recorded == replayed


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
