"""Any two runs are compared, checks too, whose records are too few for a geometry."""

from __future__ import annotations

from pathlib import Path

import pytest

from hexacell.errors import UsageError
from hexacell.services.history.evidence_comparison import compare_evidence
from hexacell.services.history.history import have_results
from hexacell.text.changes import evidence_comparison_text
from tests.hexacell.services.proposed_runs import a_cell, propose_run
from tests.hexacell.services.recorded_nights import Nights

CRASH = {"l4": 0.31}


@pytest.fixture
def nights(tmp_path: Path) -> Nights:
    return Nights(a_cell(tmp_path))


def test_a_calibration_and_a_check_of_an_unchanged_robot(nights) -> None:
    first, second = nights.calibrate().path.name, nights.check().path.name
    found = compare_evidence(nights.cell, first, second)
    assert not found.is_changed
    assert 3.0 < found.limit < 4.0
    text = evidence_comparison_text(found)
    assert "nothing changed" in text
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize("first", ["calibrate", "check"])
def test_a_leg_that_changed_between_two_runs_is_named(nights, first) -> None:
    before = getattr(nights, first)().path.name
    nights.changes = CRASH
    after = nights.check().path.name
    found = compare_evidence(nights.cell, before, after)
    assert (found.is_changed, found.leg) == (True, 4)
    (length,) = [one for one in found.causes if one.name == "l4"]
    assert abs(length.change - 0.31) < 4 * length.sigma
    assert "leg 4 changed" in evidence_comparison_text(found)


def test_backwards_the_change_is_the_opposite(nights) -> None:
    before = nights.calibrate().path.name
    nights.changes = CRASH
    after = nights.check().path.name
    forth, back = compare_evidence(nights.cell, before, after), compare_evidence(nights.cell, after, before)
    changes = [{one.name: one.change for one in found.causes}["l4"] for found in (forth, back)]
    assert changes[0] == pytest.approx(-changes[1], rel=1e-3)


def test_a_run_that_measured_nothing_is_refused(nights) -> None:
    propose_run(nights.cell, "nothing")
    with pytest.raises(UsageError, match="the run nothing says nothing of the geometry"):
        compare_evidence(nights.cell, "nothing", nights.check().path.name)


def test_only_calibrations_have_geometries_to_compare(nights) -> None:
    one, other = nights.calibrate().path.name, nights.calibrate().path.name
    assert have_results(nights.cell, (one, other))
    assert not have_results(nights.cell, (one, nights.check().path.name))
