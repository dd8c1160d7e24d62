"""Failures that are injected where a run begins a step, and what its journal then holds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from drivers.errors import GaugeSilent
from hexacell.cell.recovery import RecoverySettings
from procedures.engine.recovery import RecoveryPolicy
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from tests.procedures.runs.listening import run_until

UNATTENDED = RecoveryPolicy.of(RecoverySettings(), attended=False)
ATTENDED = RecoveryPolicy.of(RecoverySettings(), attended=True)
P2 = SetKey(phase=Phase.IDENTIFY, point=2)
SILENT = GaugeSilent("does not answer", subject="gauge y")
KEY = "P2/o03/sample"


def failing(key: str, action: Callable[[], Any], times: int = 1) -> Any:
    """A listener that does something whenever a step is begun, so many times."""
    left = [times]

    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.StepBegun) and event.step.key == key and left[0]:
            left[0] -= 1
            action()

    return listener


async def until_closed(rig: Any, *listeners: Any, policy: RecoveryPolicy) -> bool:
    """Run until the second point is measured; whether it came to that."""
    await run_until(rig, events.SetClosed, *listeners, policy=policy)
    return fold(read_journal(rig.folder.journal)).set(P2).closed
