"""Journals of before there were joints that turn are read: their numbers had keys that end in ``_mm``."""

from __future__ import annotations

from procedures.run import events

SIX = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def test_readings() -> None:
    before = {"gauges_mm": [0, 0, 0], "spread_mm": [0, 0, 0], "joints_mm": SIX, "answers": [], "counts": []}
    assert events.Reading.model_validate(before).joints == SIX
    assert "joints_mm" not in events.Reading.model_validate(before).model_dump()


def test_where_the_robot_was() -> None:
    before = {"pose": SIX, "joints_mm": SIX, "encoders_mm": SIX[::-1]}
    located = events.Located.model_validate(before)
    assert (located.joints, located.encoders) == (SIX, SIX[::-1])
    assert events.Located.model_validate({"pose": SIX}).joints is None


def test_series_at_standstill() -> None:
    at = {"phase": "P", "point": 1}
    before = {"at": at, "gauges_mm": [], "joints_mm": [SIX], "answers": [], "counts": []}
    assert events.StandstillRead.model_validate(before).joints == (SIX,)
