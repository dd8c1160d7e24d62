"""Listeners that step in at a moment of a run or let it fail, and what its journal says of it."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

import pytest

from drivers.errors import GaugeSilent
from hexacell.cell.recovery import Escalations, RecoverySettings
from hexacell.errors import Interruption
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.engine.commands import Abort, Stop
from procedures.engine.recovery import GIVE_UP
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events


class PowerCut(BaseException):
    """Nothing after it is written down: neither a word of farewell nor a stop."""


def cut_power() -> None:
    raise PowerCut


def stop_here() -> None:
    """For a run of which enough was seen; it can be resumed."""
    raise Interruption("enough")


def on(kind: type[Any], action: Any, count: int | None = 1) -> Any:
    """A listener that does something at the ``count``-th event of a kind, or at each."""
    seen = [0]

    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, kind):
            seen[0] += 1
            if count in {None, seen[0]}:
                action()

    return listener


def steps_of(rig: Any) -> list[Any]:
    """The steps that were begun."""
    return [event.step for event in happened(rig, events.StepBegun)]


def at_step(key: str, action: Callable[[], Any], times: float = math.inf) -> Any:
    """A listener that does something whenever a step is begun, at most so many times."""
    left = [times]

    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.StepBegun) and event.step.key == key and left[0]:
            left[0] -= 1
            action()

    return listener


async def cancelled(rig: Any, when: Callable[..., Any], *listeners: Any) -> None:
    """A run whose task is cancelled; ``when`` makes the listener that does it at its moment."""
    tasks: list[asyncio.Task[Any]] = []

    def cancel() -> None:
        tasks[0].cancel()

    tasks.append(asyncio.create_task(rig.run(*listeners, when(action=cancel))))
    with pytest.raises(asyncio.CancelledError):
        await tasks[0]


async def run_until(
    rig: Any, kind: type[Any], *listeners: Any, count: int = 1, policy: Escalations = GIVE_UP
) -> None:
    """Run up to the ``count``-th event of a kind; it can be resumed."""
    enough = on(kind, lambda: rig.engine.queue.put(Stop()), count)
    with pytest.raises(Interruption):
        await rig.run(*listeners, enough, policy=policy)


async def ended_by_command(rig: Any, number: int) -> bool:
    """Run until somebody aborts at an event; whether it came to that."""
    try:
        await rig.run(on(object, lambda: rig.engine.queue.put(Abort()), number))
    except Interruption:
        return True
    return False


async def ended_by_power_cut(rig: Any, number: int) -> bool:
    """Run until the process dies at an event: its journal ends there."""
    path, kept = rig.folder.journal, list[bytes]()

    def die() -> None:
        kept.append(path.read_bytes())
        raise PowerCut

    try:
        await rig.run(on(object, die, number))
    except PowerCut:
        path.write_bytes(kept[0])  # as if the engine had not got to say that it was interrupted
        return True
    return False


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


UNATTENDED = RecoverySettings().unattended
ATTENDED = RecoverySettings().attended
P2 = SetKey(phase=Phase.IDENTIFY, point=2)
SILENT = GaugeSilent("does not answer", subject="gauge y")
KEY = "P2/o03/sample"


def failing(key: str, action: Callable[[], Any], times: float = 1) -> Any:
    return at_step(key, action, times)


async def until_closed(rig: Any, *listeners: Any, policy: Escalations) -> bool:
    """Run until the second point is measured; whether it came to that."""
    await run_until(rig, events.SetClosed, *listeners, policy=policy)
    return fold(read_journal(rig.folder.journal)).set(P2).closed
