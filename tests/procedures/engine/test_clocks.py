"""Durations and decisions do not depend on the wall clock."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any

import pytest

from procedures.calibration.calibration import Mode
from procedures.journal import journal as line_format
from procedures.journal.journal import read_entries
from procedures.steps import events


@pytest.fixture
def wild_clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A clock on the wall that jumps by hours and years each time that somebody looks at it."""
    jumps = itertools.cycle([0.0, 5.0, -30_000.0, 2.0, -0.5])
    real = datetime.now

    class Clock:
        @staticmethod
        def now(zone: Any) -> datetime:
            return real(zone) + timedelta(hours=next(jumps))

    monkeypatch.setattr(line_format, "datetime", Clock)
    monkeypatch.setattr(time, "time", lambda: 3600.0 * next(jumps))
    yield Clock
    monkeypatch.undo()


async def test_a_run_does_not_depend_on_the_wall_clock(make_rig, wild_clock) -> None:
    """Noise is drawn by the cell's own clock, so that two runs of it read the same."""
    rig = make_rig(Mode.CHECK)
    begun = rig.clock.time_s
    await rig.run()
    seconds = rig.clock.time_s - begun
    jumped = [entry for entry in as_written(rig) if entry.at.year < 2024]
    assert jumped, "it did jump while readings settled"
    told = [entry.event for entry in as_written(rig)]

    rig.folder.journal.unlink()
    again = make_rig(Mode.CHECK)
    await again.run()
    assert [entry.event for entry in as_written(again)][1:] == told[1:]
    assert again.clock.time_s - begun == pytest.approx(seconds)
    assert isinstance(told[-1], events.Ended)


def as_written(rig: Any) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(line_format, "datetime", datetime)
        return read_entries(rig.folder.journal)
