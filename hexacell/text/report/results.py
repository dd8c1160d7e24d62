"""The results behind the statement: figures, uncertainty budget, parameters, what the records tell apart.

The figures are SVG text that is the same, byte for byte, whenever it is drawn.
"""

from collections.abc import Sequence

import numpy as np

from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.kinematics.parameters import LEGS
from hexacell.lengths import unit_of
from hexacell.results.run_comparison import compare_results
from hexacell.services.history.reported_run import ReportedRun
from hexacell.services.history.run_summary import require_result
from hexacell.text.parameters import ParameterRow, rows_of_changes, rows_of_run
from hexacell.text.planning import quick_accuracy_sentences
from hexacell.text.report.pages import Chapter, Paragraph, Picture, Table
from hexacell.text.svg_drawing import AFTER, BEFORE, INK, SMALLEST_MM, as_svg, new_figure
from hexacell.text.terms import run_terms_text
from hexacell.uncertainty.statement import COVERAGE_FACTOR
from procedures.run.keys import Phase

AXES_PLACE = (0.12, 0.17, 0.87, 0.72)
"""Place of the axes in a figure; to find the best one would draw each figure twice."""

LABELS_PT = 300.0
"""Height of all labels of parameters side by side; with more of them they are smaller."""


def figure_chapter(run: ReportedRun) -> Chapter | None:
    """The ball's deviations before and after, and how well the records agree; None without records."""
    pictures = tuple(one for one in (_deviations(run), _changes(run)) if one is not None)
    return Chapter("Figures", pictures) if pictures else None


def _deviations(run: ReportedRun) -> Picture | None:
    """What the gauges show at each held-out pose, as in figures 8 and 9 of the paper."""
    found, left = (run.state.held_out(phase) for phase in (Phase.BEFORE, Phase.AFTER))
    if not found and not left:
        return None
    figure, [axes] = new_figure((7.0, 2.8), AXES_PLACE)
    series = ((found, "as found", BEFORE, "o"), (left, "as left", AFTER, "s"))
    for deviations, name, colour, marker in series:
        distances = np.linalg.norm(np.array(deviations, dtype=float).reshape(-1, 3), axis=-1)
        numbers, shown = np.arange(1, len(distances) + 1), np.maximum(distances, SMALLEST_MM)
        axes.semilogy(numbers, shown, marker, color=colour, label=name, markersize=5)
    axes.set_xlabel("held-out pose")
    axes.set_ylabel("deviation of the ball, mm")
    axes.grid(visible=True, axis="y", color="#dddddd", linewidth=0.6)
    axes.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    return Picture(as_svg(figure), "Distance of the ball from its reference at each held-out pose.")


def _changes(run: ReportedRun) -> Picture | None:
    """The change of each free parameter by its expanded uncertainty."""
    if run.state.identified is None:
        return None
    rows = rows_of_run(run.state, run.settings)
    figure, [axes] = new_figure((7.0, 2.8), AXES_PLACE)
    axes.errorbar(
        np.arange(len(rows)),
        [one.change / one.unit.like_a_mm for one in rows],
        yerr=[one.expanded / one.unit.like_a_mm for one in rows],
        fmt="o",
        color=AFTER,
        markersize=3.5,
        capsize=2,
    )
    axes.axhline(0.0, color=INK, linewidth=0.6)
    names = [one.name for one in rows]
    axes.set_xticks(np.arange(len(rows)), names, rotation=90, fontsize=min(9.0, LABELS_PT / len(rows)))
    kinds = run.settings.mechanism.parameters.kinds
    axes.set_ylabel(f"change, {' or '.join(dict.fromkeys(kind.unit.shown for kind in kinds))}")
    return Picture(as_svg(figure), "Change of each parameter, with its expanded uncertainty (k = 2).")


def uncertainty_chapter(run: ReportedRun) -> Chapter | None:
    """The budget that U comes from; None without an identification."""
    if not (budget := run.document.get("uncertainty")):
        return None
    unit = unit_of(budget["standard_mm"])
    rows = [("noise of the readings", "", unit.number(budget["noise_mm"]), "measured and stated")]
    rows += [
        (
            line["name"],
            f"{line['size']:.3g} {line['unit']}",
            unit.number(line["combined_mm"]),
            line["source"],
        )
        for line in budget["lines"]
        if line["combined_mm"] >= unit.smallest
    ]
    rows.append(("standard uncertainty (root of the squares)", "", unit.number(budget["standard_mm"]), ""))
    table = Table(("Cause", "size", f"at the worst task pose, {unit.name}", "source"), tuple(rows))
    unseen = [line["name"] for line in budget["lines"] if not line["visible"]]
    note = (Paragraph(f"No record shows these: {', '.join(unseen)}."),) if unseen else ()
    return Chapter("Uncertainty budget of the identified geometry", (table, *note))


def parameter_chapter(run: ReportedRun) -> Chapter | None:
    """Old, new, change and uncertainty of each parameter; None where nothing was identified or checked."""
    rows = rows_of_run(run.state, run.settings)
    if run.state.identified is None:
        columns = ("Parameter", "unit", "change since identified", "U (k = 2)")
        cells = tuple((*_cells(one)[:2], *_cells(one)[4:]) for one in rows)
        return Chapter("Changes of the geometry", (Table(columns, cells, 2),)) if rows else None
    text = (
        "Both geometries are in the frame convention of the mechanism, so that a choice of frames is no "
        "change; the controller's config has the new one in the frames in which the task poses move least."
    )
    return Chapter("Identified geometry", (_parameter_table(rows, "old", "new"), Paragraph(text)))


def terms_chapter(run: ReportedRun) -> Chapter | None:
    """What was found beside the geometry, a row a joint or leg; None where nothing was."""
    text, taken = run_terms_text(run.state), run.state.found_terms.taken
    if not text:
        return None
    columns, rows = ["Joint or leg"], [[str(number + 1)] for number in range(LEGS)]
    for term in taken:
        columns += [f"{term.name}, {term.unit}", "U (k = 2)"]
        for row, value, sigma in zip(rows, term.values or (), term.sigma or (), strict=True):
            row += [f"{value:.3f}", f"{COVERAGE_FACTOR * sigma:.3f}"]
    table = (Table(tuple(columns), tuple(map(tuple, rows))),) if taken else ()
    return Chapter("What is not geometry", (*table, Paragraph(text)))


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
    table = _parameter_table(rows_of_changes(compared.parameters), "then", "now")
    title = f"Compared with {earlier.name} of {earlier.ended:%Y-%m-%d}"
    return Chapter(title, (Paragraph(text, is_strong=True), table))


def _parameter_table(rows: Sequence[ParameterRow], old: str, new: str) -> Table:
    columns = ("Parameter", "unit", old, new, "change", "U (k = 2)", "")
    return Table(columns, tuple((*_cells(one), one.meaning) for one in rows), 2)


def _cells(one: ParameterRow) -> tuple[str, ...]:
    values = one.figure(one.old), one.figure(one.new)
    return one.name, one.unit.shown, *values, one.figure(one.change, "+"), one.figure(one.expanded)


def observability_chapter(run: ReportedRun) -> Chapter | None:
    """What the records determine and what they hardly tell apart, and which were left out."""
    if run.state.identified is None:
        return None
    result, quick = run.state.identified.result, run.state.identified.quick
    expected = result.residuals.expected
    left_out = ", ".join(f"P{one.point}/{one.orientation} ({one.kind.value})" for one in result.outliers)
    sentences = [f"{result.records} records at {result.points} points."]
    if result.identifies is not ParameterChoice.ALL:
        sentences.append(
            "The encoders' zeros alone are identified. All else is as the controller had it, and its "
            "tolerances are its uncertainty."
        )
    sentences += [
        f"Residuals {1e3 * result.residual_rms_mm:.1f} um (rms), chi2 {result.chi2:.1f} of {expected:.0f}.",
        *([] if quick is None else [quick_accuracy_sentences(quick)]),
        f"Parameters that the records do not determine: {', '.join(result.undetermined) or 'none'}.",
        f"Records left out as false: {left_out or 'none'}.",
    ]
    pairs = run.document.get("correlated") or []
    rows = tuple((" and ".join(pair["parameters"]), f"{pair['correlation']:+.2f}") for pair in pairs[:10])
    tables = (Table(("Strongly correlated parameters", "correlation"), rows),) if rows else ()
    return Chapter("Observability", (*map(Paragraph, sentences), *tables))
