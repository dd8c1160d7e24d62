"""What has changed since an earlier run: by the results of both, or else by their records."""

from __future__ import annotations

from hexacell.results.run_comparison import ParameterDifference, RunComparison, compare_results
from hexacell.services.history.evidence_comparison import (
    CauseOfDifference,
    EvidenceComparison,
    compare_run_folders,
)
from hexacell.services.history.history import result_of_its_own
from hexacell.services.history.reported_run import ReportedRun
from hexacell.services.recorded.started_robot import started_robot
from hexacell.text.report.blocks import Block, Chapter, Paragraph, Table
from hexacell.uncertainty.statement import COVERAGE_FACTOR

COLUMNS_OF_RESULTS = ("Parameter", "unit", "then", "now", "change", "U (k = 2)", "")
COLUMNS_OF_RECORDS = ("Parameter", "unit", "change", "U (k = 2)", "score")


def comparison_chapter(earlier: ReportedRun, run: ReportedRun) -> Chapter:
    """What has changed since an earlier run.

    Raises:
        UsageError: the frames of their results differ, or the records of one say nothing of the geometry.
    """
    then, now = result_of_its_own(earlier.state), result_of_its_own(run.state)
    title = f"Compared with {earlier.name} of {earlier.ended:%Y-%m-%d}"
    if then is None or now is None:
        return Chapter(title, _by_records(_evidence_of(earlier, run)))
    return Chapter(title, _by_results(compare_results(run.settings.mechanism.parameters, then, now)))


def _by_results(compared: RunComparison) -> tuple[Block, ...]:
    text = (
        "All changes together are more than the noise of both runs explains."
        if compared.is_changed
        else "The noise of both runs explains all changes together."
    )
    rows = tuple(map(_difference_row, compared.parameters))
    return Paragraph(text, is_strong=True), Table(COLUMNS_OF_RESULTS, rows, 2)


def _by_records(found: EvidenceComparison) -> tuple[Block, ...]:
    """As ``hexacell history --compare`` has it of a check, which has no geometry of its own."""
    most = found.likeliest
    text = (
        f"Leg {found.leg} changed, as {most.name} by {most.change:+.3f} {most.unit}, "
        f"U {COVERAGE_FACTOR * most.sigma:.3f}."
        if found.is_changed
        else "The noise of the records of both explains all differences."
    )
    note = (
        "Each parameter is taken alone, as if only it had changed. By chance the largest score of an "
        f"unchanged robot exceeds {found.limit:.1f} in one case of a hundred."
    )
    rows = tuple(map(_cause_row, found.causes))
    return Paragraph(text, is_strong=True), Paragraph(note), Table(COLUMNS_OF_RECORDS, rows, 2)


def _evidence_of(earlier: ReportedRun, run: ReportedRun) -> EvidenceComparison:
    robot = started_robot(run.settings, run.started)
    return compare_run_folders(run.settings, robot, earlier.folder, run.folder)


def _difference_row(one: ParameterDifference) -> tuple[str, ...]:
    values = f"{one.before:.3f}", f"{one.after:.3f}", f"{one.change:+.3f}"
    expanded = f"{COVERAGE_FACTOR * one.sigma:.3f}"
    return one.name, one.unit, *values, expanded, "changed" if one.is_significant else ""


def _cause_row(one: CauseOfDifference) -> tuple[str, ...]:
    expanded = f"{COVERAGE_FACTOR * one.sigma:.3f}"
    return one.name, one.unit, f"{one.change:+.3f}", expanded, f"{one.score:+.1f}"
