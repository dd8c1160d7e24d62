"""The chapter on what has changed since an earlier run."""

from __future__ import annotations

from hexacell.results.run_comparison import ParameterDifference, compare_results
from hexacell.services.history.history import require_result
from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.report.blocks import Chapter, Paragraph, Table
from hexacell.uncertainty.statement import COVERAGE_FACTOR

COLUMNS_OF_RESULTS = ("Parameter", "unit", "then", "now", "change", "U (k = 2)", "")


def comparison_chapter(earlier: ReportedRun, run: ReportedRun) -> Chapter:
    """What has changed since an earlier run.

    Raises:
        UsageError: one of them identified no geometry of its own, or their frames differ.
    """
    then, now = (require_result(one.state, one.name) for one in (earlier, run))
    compared = compare_results(run.settings.mechanism.parameters, then, now)
    text = (
        "All changes together are more than the noise of both runs explains."
        if compared.is_changed
        else "The noise of both runs explains all changes together."
    )
    rows = tuple(map(_difference_row, compared.parameters))
    return Chapter(
        f"Compared with {earlier.name} of {earlier.ended:%Y-%m-%d}",
        (Paragraph(text, is_strong=True), Table(COLUMNS_OF_RESULTS, rows, 2)),
    )


def _difference_row(one: ParameterDifference) -> tuple[str, ...]:
    values = f"{one.before:.3f}", f"{one.after:.3f}", f"{one.change:+.3f}"
    expanded = f"{COVERAGE_FACTOR * one.sigma:.3f}"
    return one.name, one.unit, *values, expanded, "changed" if one.is_significant else ""
