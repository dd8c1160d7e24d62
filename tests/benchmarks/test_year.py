"""365 nights of a cell with a slow drift, a crash, a dead gauge for a week, a full disk and a power cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from hexacell.errors import ExitCode
from hexacell.services.history.cell_status import CellStatus, cell_status
from hexacell.services.history.drift_history import DriftHistory, drift_history
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Mode
from tests.benchmarks.figures import NEVER, at_least, at_most, between, most_by_chance
from tests.benchmarks.samples import sample
from tests.benchmarks.simulated_year import DEAD_GAUGE, FULL_DISK, LIMIT_MM, Year

NIGHTS = sample(__name__, "NIGHTS")
DRIFT_MM, CRASH_MM = 0.001, 0.31
FAST_DRIFT_MM, NEGLECTED_NIGHTS = 0.003, 90
DEAD = range(int(0.3 * NIGHTS), int(0.3 * NIGHTS) + 7)
FULL, CRASH, CUT = int(0.45 * NIGHTS), int(0.6 * NIGHTS), int(0.75 * NIGHTS)


@dataclass(frozen=True)
class Told:
    """The year, and what the program says of it in the end."""

    year: Year
    drift: DriftHistory
    status: CellStatus
    explanations: dict[int, list[str]]


@pytest.fixture(scope="module")
def told(tmp_path_factory) -> Told:
    faults = dict.fromkeys(DEAD, DEAD_GAUGE) | {FULL: FULL_DISK}
    year = Year(tmp_path_factory.mktemp("year"), DRIFT_MM, CRASH, CRASH_MM, faults, frozenset({CUT}))
    year.carry_out(NIGHTS)
    return Told(year, drift_history(year.cell), cell_status(year.cell), year.explanations())


@pytest.fixture(scope="module")
def neglected(tmp_path_factory) -> Year:
    """A cell that drifts beyond its limit, where nothing but checks is done."""
    year = Year(
        tmp_path_factory.mktemp("neglected"), FAST_DRIFT_MM, NEGLECTED_NIGHTS, 0.0, {}, is_corrected=False
    )
    year.carry_out(NEGLECTED_NIGHTS)
    return year


def test_no_night_is_missing_or_unexplained(told, figure) -> None:
    silent = [number for number, lines in told.explanations.items() if not any(lines)]
    judged = sum(night.verdict is not None or night.exit_code == 0 for night in told.year.nights)
    figure(f"of {NIGHTS} nights, with a verdict", judged)
    figure("nights that the history does not explain", len(silent), "", NEVER)
    assert len(told.year.nights) == NIGHTS
    for number in set(DEAD) - {FULL}:
        assert any("not begun" in line and "gauge y" in line for line in told.explanations[number])
    assert any("not begun" in line and "MB are free" in line for line in told.explanations[FULL])
    [cut] = told.explanations[CUT]
    assert cut == "not over: it is going on, or was killed"


def test_the_program_says_hardware_on_nights_with_a_fault(told) -> None:
    codes = {night.number: night.exit_code for night in told.year.nights}
    assert {codes[number] for number in (*DEAD, FULL)} == {ExitCode.HARDWARE}


def test_nothing_is_applied_falsely(told, figure) -> None:
    """A result is written only after a check that failed; the robot is better then, and within limits."""
    written = [night for night in told.year.nights if night.is_written]
    figure("results written, the first calibration included", len(written))
    for one in written:
        words = f"  night {one.number}: true error, {one.error_before_mm:.3f} mm before, after"
        figure(words, one.error_after_mm, "mm")
    before = {night.number: told.year.nights[: night.number] for night in written}
    for night in written:
        assert night.mode in {Mode.OPTIMISE, Mode.QUICK}
        assert night.verdict is Verdict.PASS
        assert night.error_after_mm < min(night.error_before_mm, LIMIT_MM)
        if night.number:
            assert [one.verdict for one in before[night.number] if one.verdict is not None][
                -1
            ] is Verdict.FAIL
    for night in told.year.nights:
        if not night.is_written:
            assert night.error_after_mm == night.error_before_mm


def test_verdicts_are_right(told, figure) -> None:
    checks = [night for night in told.year.nights if night.mode is Mode.CHECK and night.verdict]
    false_passes = [one for one in checks if one.verdict is Verdict.PASS and one.error_before_mm > LIMIT_MM]
    false_fails = [one for one in checks if one.verdict is Verdict.FAIL and one.error_before_mm < LIMIT_MM]
    undecided = [one for one in checks if one.verdict is Verdict.NOT_EVALUATED]
    figure("checks", len(checks))
    figure("  false passes", len(false_passes))
    figure("  false fails", len(false_fails), "", NEVER)
    figure("  undecided", len(undecided))
    worst = max(one.error_before_mm for one in checks if one.number != CRASH)
    figure(f"  largest true error of a night but the crash's, limit {LIMIT_MM}", worst, "mm")
    most = max((one.error_before_mm for one in false_passes), default=0.0)
    figure("  largest true error of a false pass", most, "mm")


def test_a_robot_beyond_its_limit_does_not_pass(told, neglected, figure) -> None:
    """That of the year, and one that nobody corrects."""
    checks = [one for one in (*told.year.nights, *neglected.nights) if one.mode is Mode.CHECK]
    beyond = [one for one in checks if one.error_before_mm >= LIMIT_MM + one.expanded_mm]
    passes = sum(one.verdict is Verdict.PASS for one in beyond)
    fails = sum(one.verdict is Verdict.FAIL for one in beyond)
    most = at_most(most_by_chance(0.01, len(beyond)))
    figure("of checks of a robot beyond limit + U, passes", passes, f"of {len(beyond)}", most)
    figure("  fails", fails)
    assert len(beyond) >= NEGLECTED_NIGHTS / 3
    changes = drift_history(neglected.cell).changes
    assert {change.possible_legs for change in changes} == {(2,)}


def test_alarms_are_right(told, figure) -> None:
    """The crash with its leg and night; else only the leg that drifts."""
    crashes = [one for one in told.drift.changes if one.leg == 4]
    others = [one for one in told.drift.changes if one.leg != 4]
    figure("alarms of the watch: of the crash", len(crashes))
    figure("  of the drift", len(others), "", at_least(1))
    [crash] = crashes
    at = told.year.at(CRASH)
    late = (crash.noticed.date() - at.date()).days
    unit = crash.parameter.kind.unit.value
    figure(f"  the crash of {CRASH_MM} mm, {crash.parameter.name}, as told", crash.change, unit)
    figure("  nights until noticed", late, "", between(0, 3))
    assert crash.after < at <= crash.before
    assert abs(crash.change - CRASH_MM) < 4 * crash.sigma
    of_leg_2 = sum(2 in one.possible_legs for one in others)
    certain = sum(one.possible_legs == (2,) for one in others)
    figure("  of the alarms of the drift name leg 2", of_leg_2, f"of {len(others)}", at_least(len(others)))
    figure("    and no other one", certain)


def test_the_archive_is_consistent(told, figure) -> None:
    figure("runs in the history", sum(map(len, told.explanations.values())))
    assert told.year.archive_is_consistent()
    assert told.status.in_force is not None
    last = max((night for night in told.year.nights if night.is_written), key=lambda one: one.number)
    assert told.status.in_force.summary.began == told.year.at(last.number)
    assert np.isfinite(told.year.true_error_mm(NIGHTS - 1))
