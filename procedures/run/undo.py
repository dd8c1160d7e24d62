"""Undoing records: the events that make records count no more, and the commands that ask for them."""

from __future__ import annotations

from functools import reduce

from hexacell.errors import UsageError
from procedures.run import events
from procedures.run.commands import MeasureAgain, Undo
from procedures.run.state import RunState, apply
from procedures.run.steps import Phase, SetKey

REASON = "a person asked for it"

Invalidation = events.RecordDiscarded | events.SetInvalidated


class PendingInvalidations:
    """Invalidations that wait for the end of a step.

    Each refers to the records that were there when it was requested, not to those taken meanwhile.
    """

    def __init__(self) -> None:
        self._pending: list[Invalidation] = []

    def request(self, command: Undo | MeasureAgain, state: RunState) -> str | None:
        """Add the invalidation that a command asks for; or why it is refused."""
        try:
            self._pending.append(invalidation_event(command, reduce(apply, self._pending, state)))
        except UsageError as refusal:
            return str(refusal)
        return None

    def take(self) -> list[Invalidation]:
        """All that are pending, oldest first; none is pending afterwards."""
        taken, self._pending = self._pending, []
        return taken


def invalidation_event(command: Undo | MeasureAgain, state: RunState) -> Invalidation:
    """The event that does what the command asks for.

    Raises:
        UsageError: there is no such record, or a result depends on it already.
    """
    key, orientation = (
        _last_record(state) if isinstance(command, Undo) else (command.at, command.orientation)
    )
    samples = state.set(key).samples
    if not samples or (orientation is not None and orientation not in {s.orientation for s in samples}):
        raise UsageError(f"{key} has no such record")
    if dependent := _dependent_result(key.phase, state):
        raise UsageError(f"{key} cannot be measured again: {dependent}", action="Begin a new run")
    if orientation is None or orientation == 1:
        return events.SetInvalidated(at=key, reason=REASON)
    return events.RecordDiscarded(at=key, orientation=orientation)


def _last_record(state: RunState) -> tuple[SetKey, int]:
    measured = [key for key, value in state.sets.items() if value.samples and not value.closed]
    if not measured:
        raise UsageError("there is no record to undo in the set that is being measured")
    key = state.at_pose[0] if state.at_pose and state.at_pose[0] in measured else measured[-1]
    return key, state.sets[key].samples[-1].orientation


def _dependent_result(phase: Phase, state: RunState) -> str | None:
    match phase:
        case Phase.IDENTIFY if state.identified:
            return "the geometry was identified from it"
        case Phase.BEFORE if state.committed:
            return "the controller has another geometry by now"
        case _ if state.judged:
            return "the result was judged by it"
        case _:
            return None
