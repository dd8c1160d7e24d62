"""365 nights of a cell with a slow drift, a crash, a dead gauge for a week, a full disk and a power cut."""

import pytest

from hexacell.errors import ExitCode
from hexacell.services.history.cell_status import cell_status
from hexacell.services.history.drift_history import drift_history
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Mode
from tests.benchmarks.figures import NEVER, at_least, between
from tests.benchmarks.samples import sample
from tests.benchmarks.simulated_year import DEAD_GAUGE, FULL_DISK, LIMIT_MM, Year

NIGHTS = sample(__name__, "NIGHTS")
DRIFT_MM, CRASH_MM = 0.001, 0.31
DEAD = range(int(0.3 * NIGHTS), int(0.3 * NIGHTS) + min(7, NIGHTS // 10))
FULL, CRASH, CUT = int(0.45 * NIGHTS), int(0.6 * NIGHTS), int(0.75 * NIGHTS)


@pytest.fixture(scope="module")
def year(tmp_path_factory) -> Year:
    faults = dict.fromkeys(DEAD, DEAD_GAUGE) | {FULL: FULL_DISK}
    made = Year(tmp_path_factory.mktemp("year"), DRIFT_MM, CRASH, CRASH_MM, faults, frozenset({CUT}))
    made.carry_out(NIGHTS)
    return made


def test_no_night_is_missing_or_unexplained(year, figure) -> None:
    told = year.explanations()
    silent = [number for number, lines in told.items() if not any(lines)]
    judged = sum(night.verdict is not None or night.exit_code == 0 for night in year.nights)
    figure(f"of {NIGHTS} nights, with a verdict", judged)
    figure("nights that the history does not explain", len(silent), "", NEVER)
    figure("runs in the history", sum(map(len, told.values())))
    assert len(year.nights) == NIGHTS
    for number in DEAD:
        assert any("not begun" in line and "gauge y" in line for line in told[number])
    assert any("not begun" in line and "MB are free" in line for line in told[FULL])
    assert told[CUT] == ["not over: it is going on, or was killed"]
    codes = {night.number: night.exit_code for night in year.nights}
    assert {codes[number] for number in (*DEAD, FULL)} == {ExitCode.HARDWARE}


def test_nothing_is_applied_falsely(year, figure) -> None:
    """A result is written only after a check that failed; the robot is better then, and within limits."""
    written = [night for night in year.nights if night.is_written]
    figure("results written, the first calibration included", len(written))
    for night in written:
        words = f"  night {night.number}: true error, {night.error_before_mm:.3f} mm before, after"
        figure(words, night.error_after_mm, "mm")
        before = [one.verdict for one in year.nights[: night.number] if one.verdict is not None]
        assert night.mode in {Mode.OPTIMISE, Mode.QUICK}
        assert night.verdict is Verdict.PASS
        assert night.error_after_mm < min(night.error_before_mm, LIMIT_MM)
        assert not before or before[-1] is Verdict.FAIL
    assert all(one.error_after_mm == one.error_before_mm for one in year.nights if not one.is_written)
    in_force = cell_status(year.cell).in_force
    assert in_force is not None
    assert in_force.summary.began is not None
    assert in_force.summary.began.date() == year.at(written[-1].number).date()
    assert year.archive_is_consistent()


def test_verdicts_are_right(year, figure) -> None:
    checks = [night for night in year.nights if night.mode is Mode.CHECK and night.verdict]
    false_passes = [one for one in checks if one.verdict is Verdict.PASS and one.error_before_mm > LIMIT_MM]
    false_fails = [one for one in checks if one.verdict is Verdict.FAIL and one.error_before_mm < LIMIT_MM]
    figure("checks", len(checks))
    figure("  false passes", len(false_passes))
    figure("  false fails", len(false_fails), "", NEVER)
    most = max((one.error_before_mm for one in false_passes), default=0.0)
    figure(f"  largest true error of a false pass, limit {LIMIT_MM}", most, "mm")


def test_alarms_are_right(year, figure) -> None:
    """The crash with its night, and its leg or those that records cannot tell from it; else the drift."""
    changes = drift_history(year.cell).changes
    crashes = [one for one in changes if 4 in one.possible_legs]
    figure("alarms of the crash, whose leg is among those named", len(crashes), "", between(1, 1))
    for crash in crashes:
        late = (crash.noticed.date() - year.at(CRASH).date()).days
        unit, named = crash.parameter.kind.unit.value, len(crash.possible_legs)
        figure(f"the crash of {CRASH_MM} mm, {crash.parameter.name}, as told", crash.change, unit)
        figure("  nights until noticed", late, "", between(0, 3))
        figure("  legs that it may have been of", named)
        assert crash.after < year.at(CRASH) <= crash.before
        # A coordinate of a joint of the leg may be likelier than its length, which is what changed.
        is_length = crash.parameter.name == "l4"
        assert named > 1 or not is_length or abs(crash.change - CRASH_MM) < 4 * crash.sigma
    others = [one for one in changes if one not in crashes]
    of_leg_2 = sum(2 in one.possible_legs for one in others)
    figure("alarms of the drift that name leg 2", of_leg_2, f"of {len(others)}", at_least(len(others)))
