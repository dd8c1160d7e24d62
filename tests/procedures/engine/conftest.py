"""Runs that have come to where they are disturbed."""

from __future__ import annotations

from typing import Any

import pytest

from procedures.steps import events


@pytest.fixture
def at_second_point(recording, replayed) -> Any:
    """One point measured; the second one gets four records only, which is enough to go wrong in."""
    return replayed(recording.until(events.SetClosed, count=1), identification__orientations=4)
