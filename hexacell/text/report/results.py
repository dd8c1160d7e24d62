"""The results behind the statement: uncertainty budget, parameters, what the records could tell apart."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from hexacell.checks.check_result import ParameterChange
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.kinematics.parameters import ParameterUnit
from hexacell.results.result import IdentificationResult
from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.planning import quick_accuracy_sentences
from hexacell.text.report.blocks import Block, Chapter, Paragraph, Table
from hexacell.uncertainty.statement import COVERAGE_FACTOR

SMALLEST_MM = 0.0005
"""Lines of the budget below are zero in the table, and left out."""


def uncertainty_chapter(run: ReportedRun) -> Chapter | None:
    """The budget that U comes from; none without an identification."""
    budget = run.document.get("uncertainty")
    if not budget:
        return None
    rows = [("noise of the readings", "", f"{budget['noise_mm']:.3f}", "measured and stated")]
    rows += [_budget_row(line) for line in budget["lines"] if line["combined_mm"] >= SMALLEST_MM]
    rows.append(("standard uncertainty (root of the squares)", "", f"{budget['standard_mm']:.3f}", ""))
    table = Table(("Cause", "size", "at the worst task pose, mm", "source"), tuple(rows))
    unseen = [line["name"] for line in budget["lines"] if not line["visible"]]
    text = f"No record shows these: {', '.join(unseen)}." if unseen else ""
    return Chapter("Uncertainty budget of the identified geometry", (table, *_text(text)))


def parameter_chapter(run: ReportedRun) -> Chapter | None:
    """Old, new, change and uncertainty of each parameter; none where nothing was identified or checked."""
    state = run.state
    if state.judged is not None and state.judged.check is not None and state.judged.check.changes:
        return _changes_chapter(state.judged.check.changes)
    if state.identified is None:
        return None
    table = Table(
        ("Parameter", "unit", "old", "new", "change", "U (k = 2)"), tuple(_parameter_rows(run)), 2
    )
    text = (
        "Both geometries are in the frame convention of the mechanism, so that a choice of frames is no "
        "change; the controller's config has the new one in the frames in which the task poses move least."
    )
    return Chapter("Identified geometry", (table, Paragraph(text)))


def observability_chapter(run: ReportedRun) -> Chapter | None:
    """What the records determine and what they hardly tell apart, and which were left out."""
    state, document = run.state, run.document
    if state.identified is None:
        return None
    result = state.identified.result
    expected, quick = result.residuals.expected, state.identified.quick
    undetermined = ", ".join(result.undetermined) or "none"
    sentences = [
        f"{result.records} records at {result.points} points.",
        *_choice(result),
        f"Residuals {1e3 * result.residual_rms_mm:.1f} um (rms), chi2 {result.chi2:.1f} of {expected:.0f}.",
        *([] if quick is None else [quick_accuracy_sentences(quick)]),
        f"Parameters that the records do not determine: {undetermined}.",
        f"Records left out as false: {_left_out(run)}.",
    ]
    pairs = document.get("correlated") or []
    rows = tuple((" and ".join(pair["parameters"]), f"{pair['correlation']:+.2f}") for pair in pairs[:10])
    tables = (Table(("Strongly correlated parameters", "correlation"), rows),) if rows else ()
    return Chapter("Observability", (*map(Paragraph, sentences), *tables))


def _text(text: str) -> tuple[Block, ...]:
    return (Paragraph(text),) if text else ()


def _budget_row(line: Mapping[str, Any]) -> tuple[str, str, str, str]:
    size = f"{line['size']:.3g} {line['unit']}"
    return line["name"], size, f"{line['combined_mm']:.3f}", line["source"]


def _changes_chapter(changes: tuple[ParameterChange, ...]) -> Chapter:
    rows = tuple(
        (one.name, one.unit, f"{one.change:+.3f}", f"{COVERAGE_FACTOR * one.sigma:.3f}") for one in changes
    )
    table = Table(("Parameter", "unit", "change since identified", "U (k = 2)"), rows, 2)
    return Chapter("Changes of the geometry", (table,))


def _parameter_rows(run: ReportedRun) -> Iterator[tuple[str, ...]]:
    identified, mechanism = run.state.identified, run.settings.mechanism
    assert identified is not None  # noqa: S101 - asked only then
    parameters = mechanism.parameters
    old = run.geometry_before.vector
    new = parameters.vector(identified.result.geometry)
    sigma = parameters.vector(identified.result.sigma)
    for row in np.flatnonzero(sigma > 0.0):
        unit = parameters.parameters[row].kind.unit
        decimals = 3 if unit is ParameterUnit.MM else 6
        figures = (old[row], new[row])
        yield (
            parameters.parameters[row].name,
            unit.value,
            *(f"{value:.{decimals}f}" for value in figures),
            f"{new[row] - old[row]:+.{decimals}f}",
            f"{COVERAGE_FACTOR * sigma[row]:.{decimals}f}",
        )


def _choice(result: IdentificationResult) -> list[str]:
    """Which parameters are identified, where not all are."""
    if result.identifies is ParameterChoice.ALL:
        return []
    sentence = "The encoders' zeros alone are identified. All else is as the controller had it"
    return [f"{sentence}, and its tolerances are its uncertainty."]


def _left_out(run: ReportedRun) -> str:
    assert run.state.identified is not None  # noqa: S101 - asked only then
    outliers = run.state.identified.result.outliers
    return ", ".join(f"P{one.point}/{one.orientation} ({one.kind.value})" for one in outliers) or "none"
