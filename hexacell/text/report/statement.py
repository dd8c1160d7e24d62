"""The first page of a report: the statement of conformity, its scope and rule, as found and as left.

In the order and words of ISO/IEC 17025:2017, 7.8, where they apply.
"""

from collections.abc import Iterator

from hexacell.lengths import unit_of
from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.report.pages import Block, Chapter, Facts, Paragraph, Table, Tone
from hexacell.text.verdict import VERDICT_MEANINGS, not_checked, scale_lines, teaching_sentence
from hexacell.uncertainty.statement import COVERAGE_FACTOR
from hexacell.verdict.decision import Verdict, VerifiedAccuracy
from procedures.run.keys import Phase

NO_VERDICT = "NOT EVALUATED"

TONES = {Verdict.PASS: Tone.GOOD, Verdict.FAIL: Tone.BAD}
"""Colours of the verdicts; all others are open."""

MODES = {
    "optimise": "calibration: measured, identified, written to the controller, verified",
    "quick": "quick level: carried on from the last result, written to the controller, verified",
    "check": "check: measured; nothing was changed",
    "length": "check of the length scale; nothing was changed",
}


MODELS = {
    "optimise": "Held-out poses, which took no part, test the model.",
    "quick": "The last accepted result takes part, with what may have drifted; held-out poses test it.",
    "check": "What was known from the last accepted result, or from the drawing, takes part.",
    "length": "The ball in two seats at a certified distance gives the scale of the encoders.",
}
"""What distinguishes the method of each kind of work."""


def statement_chapter(run: ReportedRun) -> Chapter:
    """The verdict, the errors that it is on, its reasons, scope and rule."""
    judged, verdict, accuracy = run.state.judged, run.state.verdict, run.state.accuracy
    meaning = "The run ended before anything could be said of the robot."
    if verdict is not None:
        is_of_length = judged is not None and judged.length is not None
        meaning = f"{'Of the length scale alone: ' if is_of_length else ''}{VERDICT_MEANINGS[verdict]}"
    errors = () if accuracy is None else accuracy.errors
    rows = tuple(
        (
            f"{name}, {shown.name}",
            shown.number(one.value),
            "not stated" if one.expanded is None else shown.number(one.expanded),
            shown.limit(one.limit),
            one.verdict.value,
        )
        for name, unit, one in errors
        for shown in [one.shown_in(unit)]
    )
    title = "" if accuracy is None else f"Largest error, one round of {accuracy.poses} task poses"
    blocks: list[Block] = [
        Paragraph(meaning, is_strong=True),
        *([Table((title, "error", "U (k = 2)", "limit", "verdict"), rows)] if rows else []),
        _reasons(run),
        Paragraph(scope_sentences(accuracy)),
        Paragraph(decision_rule(accuracy)),
    ]
    return Chapter("Statement of conformity", tuple(blocks))


def found_and_left_chapter(run: ReportedRun) -> Chapter:
    """Errors as found and as left, and what must be taught anew."""
    state = run.state
    moved = None if state.proposed is None else state.proposed.displacement
    rows = tuple(_found_and_left_rows(run))
    table = (Table(("", "as found", "as left"), rows),) if rows else ()
    is_written = state.committed is not None and not state.rolled_back
    teaching = (Paragraph(teaching_sentence(moved)),) if moved and is_written else ()
    return Chapter("As found and as left", (*table, Paragraph(_left(run)), *teaching))


def method_chapter(run: ReportedRun) -> Chapter:
    """How it was done, by what, for whom."""
    report, started = run.settings.report, run.started
    stated = (
        ("Laboratory", report.laboratory),
        ("Customer", report.customer),
        ("Place", report.place),
        ("Robot", report.machine),
        ("Serial number", report.serial_number),
    )
    facts = (
        *((name, value or "not stated in the cell file") for name, value in stated),
        ("Cell", f"{run.settings.name}, {run.settings.robot.mechanism}"),
        ("Controller's config", started.config),
        ("Kind of work", MODES[started.mode]),
        ("Begun, ended (UTC)", f"{run.began:%Y-%m-%d %H:%M}, {run.ended:%Y-%m-%d %H:%M}"),
        ("Software", started.software),
    )
    return Chapter("Subject and method", (Facts(facts), Paragraph(method_sentences(run))))


def method_sentences(run: ReportedRun) -> str:
    """How the geometry follows from what is measured."""
    return (
        "A ball on the platform is held between three dial gauges. At each point they are zeroed, the same "
        "point is commanded in other orientations, and what the gauges and the encoders of the joints then "
        "show is recorded. From the records the geometry follows by weighted least squares, with its "
        f"covariance (after Abtahi, Pendar, Alasty and Vossoughi, 2010). {MODELS[run.started.mode]}"
    )


def _reasons(run: ReportedRun) -> Block:
    """The tests of the model, or the outcome of a check or a length check."""
    if (judged := run.state.judged) is None:
        reason = "it is not over" if run.state.ended is None else run.state.ended.line
        return Paragraph(f"How it ended: {reason}.")
    if judged.verification is not None and judged.verification.tests:
        rows = (
            (test.name, f"{'holds' if test.passed else 'FAILS'}: {test.sentence}")
            for test in judged.verification.tests
        )
        return Table(("Test of the model", "result"), tuple(rows), None)
    return Paragraph(judged.line)


def scope_sentences(accuracy: VerifiedAccuracy | None) -> str:
    """Scope of the statement."""
    if accuracy is None:
        return "Nothing is stated of errors at the task."
    where = "the task poses of the cell file" if accuracy.task_named else "poses across the workspace"
    scale = " ".join(scale_lines(accuracy.length, accuracy.scale_of)) or not_checked(accuracy.scale_of)
    where += f", {accuracy.approach}" if accuracy.approach else ""
    return (
        f"This holds at {where}, at the time and under the conditions below, after the best choice of "
        f"frames that can be taught. {scale}"
    )


def decision_rule(accuracy: VerifiedAccuracy | None) -> str:
    """The rule by which errors and their uncertainty become a verdict."""
    factor = 1.0 if accuracy is None else accuracy.position.guard_band_factor
    band = "U" if factor == 1.0 else f"{factor:g} U"
    return (
        f"Decision rule: pass if error + {band} is at most the limit, fail if error - {band} is above it, "
        "conditional in between (guard band as in ILAC-G8). The error is the largest in one round of "
        "visits to all task poses, and U its expanded uncertainty, which holds in 95 of 100 cases "
        f"(k = {COVERAGE_FACTOR:g}), and is not stated where the records contradict the model. In the "
        "terms of ISO 9283 the error has pose accuracy and pose repeatability together, "
        "the latter as far as it was stated or measured."
    )


def _found_and_left_rows(run: ReportedRun) -> Iterator[tuple[str, str, str]]:
    verified = run.state.judged and run.state.judged.verification
    if verified and verified.before_mm is not None:
        poses = len(run.state.held_out(Phase.AFTER))
        name = f"mean deviation of the ball at {poses} held-out poses"
        yield _before_after(name, verified.before_mm, verified.after_mm)
    identified, accuracy = run.state.identified, run.state.accuracy
    if identified is not None and identified.improvement is not None:
        after = None if accuracy is None else accuracy.position.value
        name = "largest position error at the task poses"
        yield _before_after(name, identified.improvement.now_mm, after)


def _before_after(name: str, before_mm: float, after_mm: float | None) -> tuple[str, str, str]:
    """A row of a length before and after, in the unit of the smaller one."""
    unit = unit_of(before_mm if after_mm is None else after_mm)
    left = "-" if after_mm is None else unit.number(after_mm)
    return f"{name}, {unit.name}", unit.number(before_mm), left


def _left(run: ReportedRun) -> str:
    state = run.state
    if state.started is not None and state.started.mode not in {"quick", "optimise"}:
        return "Nothing was changed: the robot is left as it was found."
    if state.rolled_back:
        return "The previous config was restored: the robot is left as it was found."
    if state.committed is None:
        return "Nothing was written: the robot is left as it was found."
    kept = f"; kept by {state.accepted.by}" if state.accepted is not None and state.accepted.by else ""
    approved = f"approved by {state.committed.approved_by}{kept}"
    return f"The new geometry is in the controller's config, {approved}."
