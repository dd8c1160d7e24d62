"""The first page of a report, and the statement of conformity that it gives in short: rule and evidence.

In the order and words of ISO/IEC 17025:2017, 7.8, where they apply.
"""

import re
from collections.abc import Iterator
from itertools import count
from math import hypot

from hexacell.lengths import MM, unit_of
from hexacell.services.history.reported_run import ReportedRun
from hexacell.storage.atomic_files import decode_utf8, read_bytes
from hexacell.text.parameters import rows_of_run
from hexacell.text.report.charts import Mark, chart, error_card
from hexacell.text.report.pages import TEMPLATES, Chapter, Facts, Paragraph, Picture, Table, Tone
from hexacell.text.terms import found_sentence
from hexacell.text.verdict import VERDICT_MEANINGS, not_checked, scale_lines, teaching_sentence
from hexacell.verdict.decision import Verdict, VerifiedAccuracy
from procedures.run.keys import Phase

NO_VERDICT = "NOT EVALUATED"

NOT_STATED = "not stated"

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


def meaning_of(run: ReportedRun) -> str:
    """The verdict in a sentence."""
    judged, verdict = run.state.judged, run.state.verdict
    if judged is None or verdict is None:
        return "The run ended before anything could be said of the robot."
    return f"{'Of the length scale alone: ' if judged.length else ''}{VERDICT_MEANINGS[verdict]}"


def cards_of(run: ReportedRun) -> tuple[Picture, ...]:
    """The errors that the verdict is on, each with U and its limit."""
    judged, accuracy = run.state.judged, run.state.accuracy
    if judged is not None and judged.length is not None and judged.length.error is not None:
        return (error_card("Largest position error by the length scale", judged.length.error, "mm"),)
    errors = () if accuracy is None else accuracy.errors
    return tuple(error_card(f"Largest {name} error at the task", one, unit) for name, unit, one in errors)


def summary_of(run: ReportedRun, serial_numbers: str) -> tuple[Chapter, ...]:
    """What follows the errors on the first page: before and after, what was corrected, the scope."""
    state, report, is_of_length = run.state, run.settings.report, run.started.mode == "length"
    moved = None if state.proposed is None else state.proposed.displacement
    rows = tuple(_found_and_left_rows(run))
    table = (Table(("", "as found", "as left"), rows),) if rows else ()
    is_written = state.committed is not None and not state.rolled_back
    left = [_left(run), _changed(run), *([teaching_sentence(moved)] if moved and is_written else [])]
    facts = (
        ("Robot", report.machine or run.settings.mechanism.words.machine),
        ("Serial number", report.serial_number or NOT_STATED),
        ("Cell", f"{run.settings.name}, {run.settings.robot.mechanism}"),
        ("Run", run.name),
        ("Begun (UTC)", f"{run.began:%Y-%m-%d %H:%M}"),
        ("Ended (UTC)", f"{run.ended:%Y-%m-%d %H:%M}"),
        ("Place", report.place or NOT_STATED),
        ("Customer", report.customer or NOT_STATED),
        ("Laboratory", report.laboratory or NOT_STATED),
        ("Software", run.started.software),
    )
    chapters = (
        Chapter("Outcome", _outcome(run)),
        Chapter("As found and as left", (*table, *_deviations(run))),
        Chapter("What was corrected", (Paragraph(" ".join(filter(None, left))),)),
        Chapter("What it holds for", () if is_of_length else (Paragraph(scope_sentences(state.accuracy)),)),
        Chapter("Subject", (Facts(facts), Facts((("Instruments", serial_numbers),)))),
    )
    return tuple(chapter for chapter in chapters if chapter.blocks)


def _deviations(run: ReportedRun) -> tuple[Picture, ...]:
    """What the gauges show at each held-out pose, as in figures 8 and 9 of the paper; empty without."""
    phases = {"as found": Phase.BEFORE, "as left": Phase.AFTER}
    held_out = {name: run.state.held_out(phase) for name, phase in phases.items()}
    series = {name: [*map(_mark, count(1), found)] for name, found in held_out.items() if found}
    names = [str(number + 1) for number in range(max(map(len, held_out.values())))]
    caption = "Distance of the ball from its reference at each held-out pose, mm, by the gauges."
    return (chart(series, names, caption, by_decades=True),) if series else ()


def _mark(number: int, deviation: tuple[float, float, float]) -> Mark:
    x, y, z = (f"{axis} {MM.number(mm, '+')}" for axis, mm in zip("xyz", deviation, strict=True))
    size = hypot(*deviation)
    return Mark(size, f"Held-out pose {number}: {MM.length(size)} ({x}, {y}, {z})")


def _changed(run: ReportedRun) -> str:
    """The largest change of the geometry by name, and what else was found; empty without identification."""
    rows = [one for one in rows_of_run(run.state, run.settings) if not one.doubt]
    if run.state.identified is None or not rows:
        return ""
    most = max(rows, key=lambda one: abs(one.change) / one.unit.like_a_mm)
    [parameter] = (one for one in run.settings.mechanism.parameters.parameters if one.name == most.name)
    return (
        f"Largest of {len(rows)} changes: {most.name} ({parameter.kind.meaning.partition(',')[0]}) from "
        f"{most.figure(most.old)} to {most.figure(most.new)} {most.unit.shown}. "
        f"{found_sentence(run.state.found_terms)}"
    ).strip()


def statement_chapter(run: ReportedRun) -> Chapter:
    """The rule of the verdict, and the tests of the model that it rests on."""
    tests = verified.tests if (verified := run.state.judged and run.state.judged.verification) else ()
    rows = tuple((test.name, f"{'holds' if test.passed else 'FAILS'}: {test.sentence}") for test in tests)
    table = (Table(("Test of the model", "result"), rows, 2),) if rows else ()
    return Chapter("Statement of conformity", (Paragraph(decision_rule(run)), *table))


def method_chapter(run: ReportedRun) -> Chapter:
    """How it was done, with what at the ball."""
    signs = ", ".join(f"{one.name} {one.sign:+d}" for one in run.settings.gauges)
    caption = f"The gauges at the ball, axes and signs. Signs of this cell: {signs}."
    facts = (("Kind of work", MODES[run.started.mode]), ("Controller's config", run.started.config))
    blocks = (Paragraph(method_sentences(run)), Facts(facts), Picture(_gauges_svg(), caption, width="46%"))
    return Chapter("How it was measured", blocks)


def _gauges_svg() -> str:
    """The part of the drawing of the documentation that shows the gauges; its style is for it alone."""
    packaged = TEMPLATES / "gauges.svg"
    path = packaged if packaged.is_file() else TEMPLATES.parents[2] / "docs" / "gauges.svg"
    drawing = re.sub('(?s)<g id="robot">.*?</g>', "", decode_utf8(read_bytes(path), path))
    drawing = drawing.replace('viewBox="0 0 1000 560"', 'class="gauges" viewBox="540 10 460 540"')
    return drawing.replace("<style>text{", "<style>.gauges text{")


def method_sentences(run: ReportedRun) -> str:
    """How the geometry follows from what is measured."""
    return (
        "A ball on the platform is held between three dial gauges. At each point they are zeroed, the same "
        "point is commanded in other orientations, and what the gauges and the encoders of the joints then "
        "show is recorded. From the records the geometry follows by weighted least squares, with its "
        f"covariance (after Abtahi, Pendar, Alasty and Vossoughi, 2010). {MODELS[run.started.mode]}"
    )


def _outcome(run: ReportedRun) -> tuple[Paragraph, ...]:
    """What a check or a length check found, or how a run without verdict ended; empty for others."""
    if (judged := run.state.judged) is not None:
        return () if judged.verification else (Paragraph(judged.line),)
    reason = "it is not over" if run.state.ended is None else run.state.ended.line
    return (Paragraph(f"How it ended: {reason}."),)


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


def decision_rule(run: ReportedRun) -> str:
    """The rule by which errors and their uncertainty become a verdict."""
    factor = run.settings.acceptance.guard_band_factor
    band = "U" if factor == 1.0 else f"{factor:g} U"
    return (
        f"Decision rule: pass if error + {band} is at most the limit, fail if error - {band} is above it, "
        "conditional in between (guard band as in ILAC-G8). The error is the largest in one round of "
        "visits to all task poses, and U its expanded uncertainty, which holds in 95 of 100 cases "
        "(drawn as in JCGM 101), and is not stated where the records contradict the model. In the "
        "terms of ISO 9283 the error has pose accuracy and pose repeatability together, "
        "the latter as far as it was stated or measured."
    )


def _found_and_left_rows(run: ReportedRun) -> Iterator[tuple[str, ...]]:
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


def _before_after(name: str, before_mm: float, after_mm: float | None) -> tuple[str, ...]:
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
