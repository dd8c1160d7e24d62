"""Some nights of ``tests/benchmarks/test_year.py``: a dead gauge, a full disk, a crash, its correction."""

from __future__ import annotations

import pytest

from hexacell.errors import ExitCode
from hexacell.services.history.cell_status import cell_status
from hexacell.services.history.drift_history import drift_history
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Mode
from tests.benchmarks.simulated_year import DEAD_GAUGE, FULL_DISK, Year

pytestmark = pytest.mark.slow

DEAD, FULL, CRASH, NIGHTS = 2, 3, 5, 8


@pytest.fixture(scope="module")
def year(tmp_path_factory) -> Year:
    folder = tmp_path_factory.mktemp("nights")
    some = Year(folder, 0.0, CRASH, 0.31, {DEAD: DEAD_GAUGE, FULL: FULL_DISK})
    some.carry_out(NIGHTS)
    return some


def test_each_night_is_what_it_was(year) -> None:
    assert [night.mode for night in year.nights] == [
        Mode.OPTIMISE, *[Mode.CHECK] * 5, Mode.QUICK, Mode.CHECK,
    ]  # fmt: skip
    passed, failed = Verdict.PASS, Verdict.FAIL
    assert [one.verdict for one in year.nights] == [
        passed,
        passed,
        None,
        None,
        passed,
        failed,
        passed,
        passed,
    ]
    assert [year.nights[number].exit_code for number in (DEAD, FULL)] == [ExitCode.HARDWARE] * 2


def test_nights_without_a_verdict_are_explained(year) -> None:
    told = year.explanations()
    assert all(len(lines) == 1 for lines in told.values())
    assert "not begun: gauge y: does not answer" in told[DEAD][0]
    assert "MB are free" in told[FULL][0]
    assert "fail" in told[CRASH][0]


def test_the_crash_is_found_and_corrected(year) -> None:
    (change,) = drift_history(year.cell).changes
    assert change.leg == 4
    assert change.after < year.at(CRASH) <= change.before
    crash, corrected = year.nights[CRASH], year.nights[CRASH + 1]
    assert crash.error_before_mm > 0.5
    assert not crash.is_written
    assert corrected.is_written
    assert corrected.error_after_mm < 0.15
    status = cell_status(year.cell)
    assert status.in_force is not None
    assert status.in_force.summary.mode == "quick"


def test_the_archive_is_that_of_the_folders(year) -> None:
    assert year.archive_is_consistent()
