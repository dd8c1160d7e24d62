"""The results behind the statement: uncertainty budget, parameters, residuals, correlations."""

from collections.abc import Sequence
from math import hypot

from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.kinematics.parameters import JointUnit
from hexacell.lengths import UM, unit_of
from hexacell.results.run_comparison import compare_results
from hexacell.services.history.reported_run import ReportedRun
from hexacell.services.history.run_summary import require_result
from hexacell.text.parameters import ParameterRow, rows_of_changes, rows_of_run
from hexacell.text.planning import quick_accuracy_sentences
from hexacell.text.report.charts import Mark, chart
from hexacell.text.report.pages import Chapter, Facts, Paragraph, Picture, Table
from hexacell.text.terms import run_terms_text
from hexacell.uncertainty.statement import COVERAGE_FACTOR


def uncertainty_chapter(run: ReportedRun) -> Chapter | None:
    """The budget that U comes from; None without an identification."""
    if not (budget := run.document.get("uncertainty")):
        return None
    # The first documents had no parts at one pose.
    key, where = ("part_mm", "all together are") if "noise_part_mm" in budget else ("combined_mm", "it is")
    unit, noise_mm = unit_of(budget["standard_mm"]), budget.get("noise_part_mm", budget["noise_mm"])
    rows = [("noise of the readings", "measured and stated", "", unit.number(noise_mm))]
    rows += [
        (line["name"], line["source"], f"{line['size']:.3g} {line['unit']}", unit.number(line[key]))
        for line in budget["lines"]
        if line[key] >= unit.smallest
    ]
    small = [line[key] for line in budget["lines"] if 0.0 < line[key] < unit.smallest]
    if small:
        rows.append((f"{len(small)} smaller ones", "", "", unit.number(hypot(*small))))
    rows.append(("standard uncertainty u: root of the squares", "", "", unit.number(budget["standard_mm"])))
    table = Table(("Cause", "source", "size", f"part of u, {unit.name}"), tuple(rows), 2)
    unseen = [line["name"] for line in budget["lines"] if not line["visible"]]
    note = (Paragraph(f"No record shows these: {', '.join(unseen)}."),) if unseen else ()
    text = f"Each part is one standard deviation at the task pose where {where} largest."
    return Chapter("Uncertainty budget", (Paragraph(text), table, Paragraph(_expanded(run)), *note))


def _expanded(run: ReportedRun) -> str:
    """How U follows from u, and why it is another one than that of the verdict."""
    budget, accuracy = run.document["uncertainty"], run.state.accuracy
    standard, expanded = budget["standard_mm"], budget["expanded_mm"]
    if expanded is None or not standard:
        return "No U is stated: the records contradict the model."
    unit = unit_of(standard)
    text = (
        f"U = {unit.length(expanded)} = {expanded / standard:.2f} u: it holds for the largest error of all "
        "task poses in 95 of 100 cases. That is found by drawing all causes (JCGM 101), and its factor is "
        "therefore not 2, as for a single figure."
    )
    if accuracy is None or accuracy.position.expanded is None:
        return text
    stated = unit.length(accuracy.position.expanded)
    return (
        f"{text} The first page has U = {stated}: of the geometry as it was written, with what the "
        "controller corrects, and by the held-out records too, which were taken after this budget."
    )


def parameter_chapter(run: ReportedRun) -> Chapter | None:
    """Old, new, change and uncertainty of each parameter; None where nothing was identified or checked."""
    rows = rows_of_run(run.state, run.settings)
    if run.state.identified is None:
        columns = ("Parameter", "unit", "change since identified", "U (k = 2)")
        cells = tuple((*_cells(one)[:2], *_cells(one)[4:]) for one in rows)
        return Chapter("Changes of the geometry", (Table(columns, cells, 2),)) if rows else None
    symbols = tuple((kind.symbol, kind.meaning) for kind in run.settings.mechanism.parameters.kinds)
    text = (
        "A number in a name is that of the leg, a letter after it a coordinate. U is twice sigma, the "
        "standard deviation; a change of less than 3 sigma may be chance. Both geometries are in the frame "
        "convention of the mechanism, so that a choice of frames is no change; the controller's config has "
        "the new one in the frames in which the task poses move least."
    )
    table = _parameter_table(rows, "old", "new")
    return Chapter("Identified geometry", (Facts(symbols), Paragraph(text), table, _changes(rows)))


def _changes(rows: Sequence[ParameterRow]) -> Picture:
    """The change of each free parameter by its expanded uncertainty."""
    units = " or ".join(dict.fromkeys(one.unit.shown for one in rows))
    marks = [
        Mark(
            one.change / one.unit.like_a_mm,
            f"{one.label}: {one.figure(one.old)} to {one.figure(one.new)}, {one.meaning}",
            one.expanded / one.unit.like_a_mm,
        )
        for one in rows
    ]
    caption = f"Change of each parameter, {units}, with its expanded uncertainty (k = 2)."
    return chart({"change": marks}, [one.name for one in rows], caption)


def terms_chapter(run: ReportedRun) -> Chapter | None:
    """What was found beside the geometry, a row a joint or leg; None where nothing was."""
    text, taken = run_terms_text(run.state), run.state.found_terms.taken
    if not text:
        return None
    columns, rows = (
        ["Joint or leg"],
        [[str(leg)] for leg in range(1, run.settings.mechanism.joint_count + 1)],
    )
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
    left_out = ", ".join(f"P{one.point}/{one.orientation} ({one.kind.value})" for one in result.outliers)
    sentences = [f"{result.records} records at {result.points} points."]
    if result.identifies is not ParameterChoice.ALL:
        sentences.append(
            "The encoders' zeros alone are identified. All else is as the controller had it, and its "
            "tolerances are its uncertainty."
        )
    residuals = (
        f"At the ball the residuals are {UM.number(result.residual_rms_mm)} um (rms), "
        f"{result.residuals.ratio:.2f} times what the noise counted with explains there, enlarged by the "
        f"legs. In units of that noise their squares add up to chi2 = {result.chi2:.1f}; "
        f"{result.residuals.expected:.0f} is expected."
    )
    sentences += [
        residuals,
        *([] if quick is None else [quick_accuracy_sentences(quick)]),
        f"Parameters that the records do not determine: {', '.join(result.undetermined) or 'none'}.",
        f"Records left out as false: {left_out or 'none'}.",
    ]
    pairs = run.document.get("correlated") or []
    rows = tuple((" and ".join(pair["parameters"]), f"{pair['correlation']:+.2f}") for pair in pairs[:10])
    tables = (Table(("Strongly correlated parameters", "correlation"), rows),) if rows else ()
    return Chapter("Records and residuals", (*map(Paragraph, sentences), *_noise_table(run), *tables))


def _noise_table(run: ReportedRun) -> tuple[Table, ...]:
    """The noise that was counted with beside that in the residuals, in one unit; empty if not known."""
    noise, rows = run.document.get("noise") or {}, []
    for key in (key for key in noise if noise["told_apart"] and key.startswith(("encoder", "gauge"))):
        instrument, _, unit = key.partition("_")
        level = {name: f"{1e3 * size:.2f}" for name, size in noise[key].items()}
        found = "{estimated} +- {standard_error}" if noise[key]["seen"] else "below {at_most}"
        rows.append(
            (f"{instrument}, {JointUnit(unit).thousandth}", level["stated"], found.format_map(level))
        )
    columns = ("Noise of a record, one sigma", "counted with", "found in the residuals")
    return (Table(columns, tuple(rows)),) if rows else ()
