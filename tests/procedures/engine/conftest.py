"""Runs that have come to where they are disturbed."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from procedures.journal.journal import Journal
from procedures.steps import events


@pytest.fixture
def at_second_point(recording, replayed) -> Any:
    """One point measured; the second one gets four records only, which is enough to go wrong in."""
    return replayed(recording.until(events.SetClosed, count=1), identification__orientations=4)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


@pytest.fixture
def journal(path: Path) -> Iterator[Journal]:
    with Journal(path) as opened:
        yield opened
