"""Listeners that step in at a moment of a run, and what its journal says of it."""

from __future__ import annotations

from typing import Any

from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase
from procedures.run.state import RunState
from procedures.steps import events


def on(kind: type[Any], action: Any, count: int = 1) -> Any:
    """A listener that does something at the ``count``-th event of a kind."""
    seen = [0]

    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, kind):
            seen[0] += 1
            if seen[0] == count:
                action()

    return listener


def before_sampling(key: str, action: Any) -> Any:
    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.StepBegun) and event.step.key == key:
            action()

    return listener


def happened(rig: Any, kind: type[Any]) -> list[Any]:
    return [event for event in read_journal(rig.folder.journal) if isinstance(event, kind)]


GOOD = AcceptanceGate(name="converged", passed=True, sentence="The solver ended well.")
FORBIDDEN = AcceptanceGate(name="within tolerance", passed=False, sentence="Beyond: l3 (-13.00 mm).")
DOUBTFUL = AcceptanceGate(name="small", passed=False, sentence="It is 20 mm.", needs_person=True)


def proposed(recording, *gates: AcceptanceGate) -> list[events.Event]:
    *before, last = recording.until(events.Proposed)
    return [*before, last.model_copy(update={"gates": gates, "displacement": None})]


def with_tiny_deviations_before(history) -> list[events.Event]:
    """As if the uncalibrated robot had been nearly perfect: whatever comes is worse."""
    return [
        event.model_copy(update={"deviation_mm": (0.0, 0.0, 1e-6)})
        if isinstance(event, events.RecordTaken) and event.at.phase is Phase.BEFORE
        else event
        for event in history
    ]


def commanding(rig: Any) -> Any:
    """The geometry that the simulated controller commands with."""
    return rig.machine._geometry.geometry


def somebody_edits(rig: Any) -> bytes:
    config = rig.cell.config_path
    config.write_bytes(config.read_bytes() + b"# somebody was here\n")
    edited: bytes = config.read_bytes()
    return edited
