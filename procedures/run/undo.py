"""What it takes to measure again what was measured: the event that makes records count no more."""

from __future__ import annotations

from hexacell.errors import UsageError
from procedures.run import events
from procedures.run.commands import MeasureAgain, Undo
from procedures.run.state import RunState
from procedures.run.steps import Phase, SetKey

ASKED_FOR = "a person asked for it"


def invalidation_event(
    command: Undo | MeasureAgain, state: RunState
) -> events.RecordDiscarded | events.SetInvalidated:
    """The event that does what the command asks for.

    Raises:
        UsageError: there is no such record, or what followed rests on it already.
    """
    key, orientation = (
        _last_record(state) if isinstance(command, Undo) else (command.at, command.orientation)
    )
    samples = state.set(key).samples
    if not samples or (orientation is not None and orientation not in {s.orientation for s in samples}):
        raise UsageError(f"{key} has no such record")
    if used := _rests_on(key.phase, state):
        raise UsageError(f"{key} cannot be measured again: {used}", action="Begin a new run")
    if orientation in {None, 1}:
        return events.SetInvalidated(at=key, reason=ASKED_FOR)
    assert orientation is not None  # noqa: S101 - told to the type checker
    return events.RecordDiscarded(at=key, orientation=orientation)


def _last_record(state: RunState) -> tuple[SetKey, int]:
    measured = [key for key, value in state.sets.items() if value.samples and not value.closed]
    if not measured:
        raise UsageError("there is no record to undo in the set that is being measured")
    key = state.standing[0] if state.standing and state.standing[0] in measured else measured[-1]
    return key, state.sets[key].samples[-1].orientation


def _rests_on(phase: Phase, state: RunState) -> str | None:
    match phase:
        case Phase.IDENTIFY if state.identified:
            return "the geometry was identified from it"
        case Phase.BEFORE if state.committed:
            return "the controller has another geometry by now"
        case _ if state.judged:
            return "the result was judged by it"
        case _:
            return None
