"""The report of one run, put together."""

from __future__ import annotations

from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.report.blocks import Report, Tone
from hexacell.text.report.comparison import comparison_chapter
from hexacell.text.report.figures import figure_chapter
from hexacell.text.report.provenance import (
    authorisation_chapter,
    conditions_chapter,
    integrity_chapter,
    traceability_chapter,
)
from hexacell.text.report.results import (
    observability_chapter,
    parameter_chapter,
    uncertainty_chapter,
)
from hexacell.text.report.statement import (
    NO_VERDICT,
    TONES,
    found_and_left_chapter,
    method_chapter,
    statement_chapter,
    verdict_of,
)

TITLES = {
    "optimise": "Calibration report",
    "quick": "Calibration report (quick level)",
    "check": "Report of a check",
    "length": "Report of a length check",
}


def report_of(run: ReportedRun, earlier: ReportedRun | None = None) -> Report:
    """What is said of a run, the verdict first; and what has changed since an ``earlier`` one, if named.

    Raises:
        UsageError: the two cannot be compared.
    """
    verdict = verdict_of(run)
    chapters = (
        statement_chapter(run),
        found_and_left_chapter(run),
        method_chapter(run),
        figure_chapter(run),
        uncertainty_chapter(run),
        parameter_chapter(run),
        None if earlier is None else comparison_chapter(earlier, run),
        observability_chapter(run),
        conditions_chapter(run),
        traceability_chapter(run),
        integrity_chapter(run),
        authorisation_chapter(run),
    )
    return Report(
        title=TITLES[run.started.mode],
        identifier=run.identifier,
        issued=run.ended.date(),
        verdict=NO_VERDICT if verdict is None else verdict.value.upper(),
        tone=Tone.OPEN if verdict is None else TONES.get(verdict, Tone.OPEN),
        chapters=tuple(chapter for chapter in chapters if chapter is not None),
    )
