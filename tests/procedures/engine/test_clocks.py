"""Durations and decisions do not depend on the wall clock."""

from __future__ import annotations

import ast
import itertools
import time
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from procedures.calibration.calibration import Mode
from procedures.journal import journal as line_format
from procedures.journal.journal import read_entries
from procedures.steps import events

CHECKOUT = Path(__file__).parents[3]
WALL_CLOCKS = {
    "time.time",
    "time.time_ns",
    "time.localtime",
    "time.gmtime",
    "datetime.now",
    "datetime.utcnow",
}
MAY_LOOK = {
    "hexacell/runs/run_folder.py": "names a run folder",
    "hexacell/services/preflight.py": "warns; the run itself decides",
    "hexacell/services/run/calibration_run.py": "says which certificates have expired; a person decides",
    "hexacell/services/schedule/unattended_runs.py": "keeps quiet hours, and notes when a run was refused",
    "hexacell/services/history/retention.py": "says which runs are old; a person deletes them",
    "hexacell/services/history/cell_status.py": "dates what an archive gets; says what is overdue",
    "hexacell/services/notify/notice.py": "dates a notice",
    "hexacell/services/notify/outbox.py": "gives up notices that were tried and are days old",
    "hexacell/config/write_record.py": "dates what was written into a config",
    "hexacell/runs/cell_lock.py": "says since when somebody holds a cell",
    "procedures/journal/journal.py": "dates a record",
    "drivers/wire_trace.py": "dates what went over a wire",
}


def looks_at_the_wall(source: Path) -> bool:
    calls = (node for node in ast.walk(ast.parse(source.read_text())) if isinstance(node, ast.Call))
    return any(ast.unparse(call.func) in WALL_CLOCKS for call in calls)


def test_the_wall_clock_is_read_only_by_the_listed_modules() -> None:
    """A file may be added here only if a clock that is set back or forth does no harm in it."""
    sources = itertools.chain.from_iterable(
        (CHECKOUT / package).rglob("*.py") for package in ("hexacell", "drivers", "procedures")
    )
    looking = {str(path.relative_to(CHECKOUT)) for path in sources if looks_at_the_wall(path)}
    assert looking <= set(MAY_LOOK)


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
