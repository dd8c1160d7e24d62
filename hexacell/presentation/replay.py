"""Text for a replay: what differs from the recording, the verdict last."""

from __future__ import annotations

from hexacell.application.replay_run import Replay
from hexacell.presentation.layout import wrapped
from procedures.replay.comparison import Aspect, Difference

LISTED = 10
"""How many differences are printed."""


def replay_report(replayed: Replay) -> str:
    """The differences, those that count first, and the verdict."""
    found = sorted(replayed.tally.differences, key=lambda one: not replayed.counts(one))
    lines = [wrapped(_line(replayed, difference), indent=4) for difference in found[:LISTED]]
    if len(found) > LISTED:
        lines.append(f"and {len(found) - LISTED} more (--json lists them)")
    if any(one.aspect is Aspect.DECISION for one in found) and not replayed.is_same_software:
        lines.append(
            wrapped(f"{replayed.recorded_by} recorded it: {replayed.replayed_by} may decide otherwise.")
        )
    return "\n".join([*lines, _verdict(replayed)])


def _line(replayed: Replay, difference: Difference) -> str:
    return f"{'NO' if replayed.counts(difference) else '--'}  {difference}"


def _verdict(replayed: Replay) -> str:
    tally = replayed.tally
    what = f"{tally.decisions} decisions and {tally.results} results of {replayed.events} events"
    if replayed.is_same:
        return f"{what}: the same as recorded"
    first = next(one for one in tally.differences if replayed.counts(one))
    return f"{what}: different, first in line {first.line} ({first.place})"
