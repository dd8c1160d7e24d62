"""What the time of a run was spent on, by the times at which the lines of its journal were written.

What its moves and readings took beside the shortest time for them is what they will take in the next run.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import median

import numpy as np

from hexacell.campaign.time_model import USUAL, Overheads, Seconds, TimeKind, no_seconds, speed_limits
from hexacell.cell.measuring import TimingSettings
from hexacell.cell.model import CellSettings
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion.durations import line_durations
from hexacell.robot.model import Robot
from procedures.journal.journal import Entry
from procedures.run.keys import SixNumbers
from procedures.steps import events

ENOUGH = 8
"""So many moves, and readings, tell what the others take."""

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


def overheads_of(entries: Sequence[Entry], settings: CellSettings, robot: Robot) -> Overheads | None:
    """What the moves and readings of a run took beside the shortest time for them.

    The medians of those that were not disturbed; None where there are too few, or the cell's clock is
    faster than real time: then they are mostly the computer's own time.
    """
    moves, readings = list(_moves(entries)), list(_readings(entries, settings.timing.window_s))
    if min(len(moves), len(readings)) < ENOUGH or settings.timing.clock_factor != 1.0:
        return None
    starts = PoseBatch.of([Pose(*start) for start, _, _ in moves])
    ends = PoseBatch.of([Pose(*end) for _, end, _ in moves])
    speeds = speed_limits(settings.speed, at_gauges=True)
    shortest = line_durations(robot.mechanism, robot.controller, robot.branch, starts, ends, speeds)
    beside = np.array([seconds for _, _, seconds in moves]) - shortest
    placed = [
        _seconds(pair) for pair in pairwise(entries) if isinstance(pair[1].event, events.GaugesPlaced)
    ]
    return Overheads(
        max(0.0, float(np.nanmedian(beside))),
        max(0.0, median(readings)),
        median(placed) if placed else USUAL.place_s,
    )


def _moves(entries: Sequence[Entry]) -> Iterator[tuple[SixNumbers, SixNumbers, float]]:
    """Start, end and seconds of the straight moves to records, with gauges at the ball all the way."""
    start: SixNumbers | None = None
    for before, after in pairwise(entries):
        match before.event, after.event:
            case events.StepBegun(step=events.Move() as move), events.Arrived(pose=end):
                is_straight = move.waypoint is None and not move.from_elsewhere
                if start is not None and is_straight and move.orientation > 1:
                    yield start, end, _seconds((before, after))
                start = end
            case events.StepBegun(step=events.Move()), _:
                start = None


def _readings(entries: Sequence[Entry], window_s: float) -> Iterator[float]:
    """What each record took beside its windows, s."""
    windows = 1
    for before, after in pairwise(entries):
        if isinstance(after.event, events.NoiseMeasured):
            windows = after.event.noise.windows
        if isinstance(after.event, events.RecordTaken):
            yield _seconds((before, after)) - windows * window_s


def _seconds(pair: tuple[Entry, Entry]) -> float:
    return pair[1].monotonic_s - pair[0].monotonic_s
