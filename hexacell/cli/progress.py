"""What a run is doing, as it happens: a bar on a terminal, a line a point anywhere."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Self

import numpy as np
from rich.console import Console as RichConsole
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from hexacell.cli.console import Console
from hexacell.presentation.planning import minutes_words
from procedures.run import events
from procedures.run.state import RunState
from procedures.run.steps import Compute, Move, Phase, Place, RunForecast, SetKey

COMPUTING = {
    "lend": "lending the controller a better geometry",
    "take back": "taking the lent geometry back",
    "identify": "identifying the geometry",
    "propose": "preparing the new config",
    "commit": "writing the config and having it read",
    "judge": "judging the held-out points",
    "roll back": "putting the old config back",
}
REWRITTEN = {
    "lent": "the controller has a better geometry while the points are measured",
    "taken back": "the controller has its own geometry again",
    "rolled back": "the old geometry is back in the controller",
}
PHASES = {
    Phase.IDENTIFY: "point {}",
    Phase.BEFORE: "held-out point {}, before",
    Phase.AFTER: "held-out point {}, after",
}


class RunProgress:
    """A listener of the engine that shows records as they land.

    ``has_begun`` tells whether the run exists on the disk, and so can be resumed.
    """

    def __init__(self, console: Console, expected_records: int) -> None:
        self.has_begun = False
        self._console = console
        self._forecast: RunForecast | None = None
        self._bar = _bar()
        self._task = self._bar.add_task("connecting", total=expected_records)

    def __call__(self, event: events.Event, state: RunState) -> None:
        """Show one event."""
        if not self.has_begun:
            # Not as progress: what a former attempt measured says nothing about the speed of this one.
            self._bar.reset(self._task, completed=settled(state))
            self.has_begun = True
        self._make_room(event)
        self._bar.update(self._task, completed=settled(state), description=doing(event))
        if told := words(event, state):
            self._console.say(told)
        if line := self._promised(event):
            self._console.say(line)

    def _promised(self, event: events.Event) -> str | None:
        """Where a set of records has brought the predicted error, once the set is done."""
        match event:
            case events.StepBegun(step=Move(expected=expected)) if expected is not None:
                self._forecast = expected.forecast
            case events.SetClosed(at=SetKey(phase=Phase.IDENTIFY)) if self._forecast is not None:
                return forecast_line(self._forecast)
        return None

    def make_room(self) -> None:
        """Take the bar away until the next event: a person is asked something."""
        self._bar.stop()

    def _make_room(self, event: events.Event) -> None:
        """Take the bar away as long as a person may be asked something."""
        match event:
            case (
                events.StepBegun(step=Place() | Compute(kind="commit"))
                | events.Paused()
                | events.Interrupted()
            ):
                self._bar.stop()
            case _:
                self._bar.start()

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()


def _bar() -> Progress:
    terminal = sys.stderr is not None and sys.stderr.isatty()
    return Progress(
        TextColumn("{task.description:<40}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("left"),
        console=RichConsole(file=sys.stderr),
        transient=True,
        disable=not terminal,
        # Words on the same terminal go above the bar; those for a file or a pipe go there.
        redirect_stdout=sys.stdout is not None and sys.stdout.isatty(),
    )


def settled(state: RunState) -> int:
    """How many records and closings of sets a run has."""
    return sum(len(measured.samples) + measured.closed for measured in state.sets.values())


def doing(event: events.Event) -> str | None:
    """What is being done from now on, in a few words; nothing where that does not change."""
    match event:
        case events.StepBegun(step=Move() as step):
            return f"{name(step.at)}, orientation {step.orientation}{_promise(step)}"
        case events.StepBegun(step=Compute() as step):
            return COMPUTING[step.kind]
        case _:
            return None


def _promise(step: Move) -> str:
    """The predicted error now and at the end, where a move has been chosen for it."""
    forecast = step.expected and step.expected.forecast
    return f": {forecast.now_mm:.3f} -> {forecast.end_mm:.3f} mm" if forecast else ""


def forecast_line(forecast: RunForecast) -> str:
    """What is known after the record that was forecast, and what going on would gain."""
    line = f"  predicted error at the task {forecast.next_mm:.3f} mm"
    left = forecast.records - 1
    if left < 1:
        return line
    gain = forecast.next_mm - forecast.end_mm
    minutes = minutes_words(forecast.minutes * left / forecast.records)
    return f"{line}; going on gains {gain:.3f} mm in {minutes}"


def words(event: events.Event, state: RunState) -> str | None:
    """What there is to say about an event, if anything."""
    match event:
        case events.SetClosed():
            return set_line(event, state)
        case events.SetInvalidated():
            return f"{name(event.at)} is measured again: {event.reason}"
        case events.RecordRejected():
            return f"{name(event.at)}, orientation {event.orientation} left out: {event.reason}"
        case events.Committed():
            return f"written to the controller, approved by {event.approved_by}"
        case events.ProvisionalApplied() | events.ProvisionalReverted() | events.RolledBack():
            return REWRITTEN[event.kind]
        case _:
            return _interlude(event)


def _interlude(event: events.Event) -> str | None:
    """What there is to say about interruptions and what followed them."""
    match event:
        case events.ReferenceConfirmed():
            return f"{name(event.at)} goes on: its reference is as it was"
        case events.RecordDiscarded():
            return f"{name(event.at)}, orientation {event.orientation} is measured again"
        case events.Failed():
            return f"{event.reason}\n  attempt {event.attempt}: {event.action.value}"
        case events.CommandRejected():
            return f"{event.command}: {event.reason}"
        case events.Paused() | events.Resumed():
            return event.kind
        case _:
            return None


def name(key: SetKey) -> str:
    """A set in words."""
    return PHASES[key.phase].format(key.point)


def set_line(closed: events.SetClosed, state: RunState) -> str:
    """One line about a set that is done, which fits a terminal of 80 columns."""
    samples = state.set(closed.at).samples
    largest = max(float(np.abs(sample.deviation_mm).max()) for sample in samples)
    drift = float(np.abs(closed.drift_mm).max())
    return (
        f"{name(closed.at):24} {len(samples):2} records, "
        f"largest deviation {largest:.3f} mm, drift {drift:.3f} mm"
    )
