"""What a run is doing, as it happens: a bar on a terminal, a line a point anywhere else."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Self

import numpy as np
from rich.console import Console as RichConsole
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from hexacell.cli.console import Console
from procedures import events
from procedures.state import RunState
from procedures.steps import Compute, Move, Phase, SetKey

COMPUTING = {
    "identify": "identifying the geometry",
    "propose": "preparing the new config",
    "commit": "writing the controller's config and reloading it",
    "judge": "judging the held-out points",
    "roll back": "putting the old config back",
}
PHASES = {
    Phase.IDENTIFY: "point",
    Phase.BEFORE: "held-out point, before:",
    Phase.AFTER: "held-out point, after:",
}


class RunProgress:
    """A listener of the engine that shows records as they land."""

    def __init__(self, console: Console, expected_records: int) -> None:
        self._console = console
        self._bar = Progress(
            TextColumn("{task.description:<46}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=RichConsole(file=sys.stderr),
            transient=True,
            disable=not sys.stderr.isatty(),
        )
        self._task = self._bar.add_task("connecting", total=expected_records)

    def __call__(self, event: events.Event, state: RunState) -> None:
        """Show one event."""
        match event:
            case events.StepBegun(step=Move() as step):
                self._bar.update(self._task, description=f"{name(step.at)}, orientation {step.orientation}")
            case events.StepBegun(step=Compute() as step):
                self._bar.update(self._task, description=COMPUTING[step.kind])
            case events.Sampled() | events.Refused():
                self._bar.advance(self._task)
                self._warn(event)
            case events.SetClosed():
                self._bar.advance(self._task)
                self._console.say(set_line(event, state))
            case events.Committed():
                self._console.say(f"written to the controller, approved by {event.approved_by}")
            case events.RolledBack():
                self._console.say("the old geometry is back in the controller")
            case _:
                pass

    def _warn(self, event: events.Sampled | events.Refused) -> None:
        if isinstance(event, events.Refused):
            self._console.say(f"{name(event.at)}, orientation {event.orientation} left out: {event.reason}")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()


def name(key: SetKey) -> str:
    """A set in words."""
    return f"{PHASES[key.phase]} {key.point}"


def set_line(closed: events.SetClosed, state: RunState) -> str:
    """One line about a set that is done."""
    samples = state.set(closed.at).samples
    largest = max(float(np.abs(sample.deviation_mm).max()) for sample in samples)
    drift = float(np.abs(closed.drift_mm).max())
    return (
        f"{name(closed.at):26} {len(samples):3} records, largest deviation {largest:6.3f} mm, "
        f"reference came back within {drift:.3f} mm"
    )
