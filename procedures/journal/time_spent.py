"""What the time of a run was spent on, by the times at which the lines of its journal were written."""

from collections.abc import Sequence
from itertools import pairwise

from hexacell.campaign.time_model import Seconds, TimeKind, no_seconds
from hexacell.cell.measuring import TimingSettings
from procedures.journal.journal import Entry
from procedures.steps import events

OF_THE_CELL = {TimeKind.MOVING, TimeKind.READING}
"""What passes by the cell's clock, which in a simulated cell may be faster than real time."""


def time_spent(entries: Sequence[Entry], timing: TimingSettings) -> Seconds:
    """How long was spent on each kind; what lies between an interruption and the next line is left out."""
    spent, windows = no_seconds(), 1
    for before, after in pairwise(entries):
        seconds = after.monotonic_s - before.monotonic_s
        event = before.event
        if isinstance(event, events.NoiseMeasured):
            windows = event.noise.windows
        if seconds < 0.0 or isinstance(event, events.Interrupted):  # the computer was started anew
            continue
        kind = _kind(event)
        seconds *= timing.clock_factor if kind in OF_THE_CELL else 1.0
        if kind is TimeKind.READING and not isinstance(after.event, events.StandstillRead):
            read = windows if isinstance(after.event, events.RecordTaken) else 1
            reading = min(seconds, read * timing.window_s)
            spent[TimeKind.SETTLING] += seconds - reading
            seconds = reading
        spent[kind] += seconds
    return spent


def _kind(event: events.Event) -> TimeKind:
    """What is done between an event and the next one."""
    match event:
        case events.StepBegun(step=step):
            return step.takes
        case events.Paused() | events.Failed(action=events.Action.ASK):
            return TimeKind.ASKING
    return TimeKind.DECIDING
