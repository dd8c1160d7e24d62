"""Which events of the journal are what came of a step, and which of those can be derived again.

Whatever is not listed here was caused from outside, by a person, a fault or a policy, and is taken
as it stands.
"""

from __future__ import annotations

from procedures.events import Event
from procedures.steps import Step

OUTCOMES: dict[str, frozenset[str]] = {
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

MEASURED = frozenset({"confirmed", "voided", "closed"})
"""Kinds that can be derived again only from the reading that they hold; version 1 kept none."""

BROKEN_OFF = frozenset({"interrupted", "failed", "paused"})
"""After these the step that was being done is over without an outcome."""

COMPUTED = frozenset({"lend", "take back", "identify", "propose", "commit", "judge"})
"""Steps whose failure follows from what is recorded, unless it came from a device or the disk."""


def is_outcome(step: Step, event: Event) -> bool:
    """Whether an event is what came of a step, with all that it was made from."""
    is_whole = event.kind not in MEASURED or getattr(event, "reading", None) is not None
    return is_whole and event.kind in OUTCOMES.get(step.kind, ())
