"""Views of results: the review of a run, verdict and scope first, and the list of past runs."""

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.text.config_changes import pending_text
from hexacell.text.line_face import event_text
from hexacell.text.parameters import parameter_table, rows_of_run
from hexacell.text.screens.questions import PERSON, approval_refusal
from hexacell.text.screens.run_picture import RunPicture
from hexacell.text.screens.views import Choice, PlotView, QuestionView, Series, Urgency
from hexacell.text.verdict import VERDICT_MEANINGS
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import DeviationStatistics
from procedures.run.keys import Phase
from procedures.run.questions import PendingChange, WrittenResult
from procedures.run.state import RunState

PROPOSAL_WAITS = "Its proposal can still be written: w asks for it, with the change."
READING = "Reading the runs of this cell ..."
WHAT_TO_PRESS = (
    "Enter  watch the chosen run again      v  compare it with the one before it",
    "b      go back to the config that it wrote; if the controller has it: undo it",
    "w      write its proposal, where it has one, into the controller's config",
    "o      the drift of each parameter over all runs",
)

URGENCIES = {None: Urgency.CALM, Verdict.PASS: Urgency.CALM, Verdict.FAIL: Urgency.ALARM}
"""How much attention a verdict needs, if there is one; all others need some."""


def review_texts(
    picture: RunPicture, settings: CellSettings | None, *, may_write: bool = False
) -> dict[str, str]:
    """The texts of a result, by the part of the screen that shows each; the verdict first.

    ``may_write`` is whether this is a recorded run whose proposal can be written.
    """
    state, subject = picture.state, picture.question and picture.question.subject
    change = pending_text(subject) if isinstance(subject, PendingChange) else ""
    verdict = "No verdict yet: it is given once the held-out poses are measured."
    if state.verdict is not None:
        verdict = f"{state.verdict.upper()}: {VERDICT_MEANINGS[state.verdict]}"
    header, *parameters = parameter_table(rows_of_run(state, settings))
    return {
        "verdict": verdict,
        "scope": "\n".join(_scope(state)),
        "approval": f"{_approval(picture)} {PROPOSAL_WAITS}" if may_write else _approval(picture),
        "comparison": "\n".join(_comparison(state)),
        "parameters-header": header,
        "parameters": "\n".join(parameters) or "The geometry is not identified yet.",
        "change": change or "There is no change yet.",
    }


def _scope(state: RunState) -> tuple[str, ...]:
    """Scope of the verdict, without the verdict itself, which stands above it."""
    if state.judged is None:
        return ("The length scale was not checked.",) if state.identified else ()
    lines = (event_text(state.judged, state) or "").splitlines()
    kept = [line.removeprefix("  ") for line in lines if not line.startswith("verdict: ")]
    return tuple(kept or [state.judged.line])


def _approval(picture: RunPicture) -> str:
    state, question = picture.state, picture.question
    if question is not None and isinstance(question.subject, PendingChange):
        refusal = approval_refusal(question.subject.gates)
        return refusal or "Waiting for you: w shows the change, to approve or to decline it."
    if question is not None and isinstance(question.subject, WrittenResult):
        return "Waiting for you: w asks whether the result is kept."
    if state.rolled_back:
        return "The old config was restored."
    if state.committed is not None:
        return f"Written to the controller, approved by {state.committed.approved_by}."
    if state.proposed is not None:
        failed = [gate.sentence for gate in state.proposed.gates if not gate.passed]
        return f"Not approved. {' '.join(failed)}".strip()
    missing = "the held-out poses with the old geometry are still to be measured"
    if state.started is not None and state.started.mode not in {"quick", "optimise"}:
        missing = "this run changes nothing"
    elif state.identified is None:
        missing = "the geometry is not identified"
    return f"Approving is not possible yet: {missing}."


def _comparison(state: RunState) -> tuple[str, ...]:
    """Mean and largest distance of the ball from its reference, with the old and the new geometry."""
    rows = []
    for name, phase in (("before", Phase.BEFORE), ("after", Phase.AFTER)):
        deviations = state.held_out(phase)
        if (found := DeviationStatistics.of(deviations)) is None:
            rows.append(f"{name:8}not measured yet")
            continue
        largest = float(np.linalg.norm(deviations, axis=-1).max())
        rows.append(f"{name:8}mean {found.mean_mm:7.3f}   largest {largest:7.3f} mm   {found.poses} poses")
    return tuple(rows)


def deviation_plot(state: RunState) -> PlotView:
    """The ball's distance from its reference at each held-out pose, as figures 8 and 9 of the paper."""
    series = []
    for name, marker, phase in (("before", "o", Phase.BEFORE), ("after", "x", Phase.AFTER)):
        sizes = (max(float(np.linalg.norm(one)), 1e-4) for one in state.held_out(phase))
        series.append(Series(name, marker, tuple((float(n), size) for n, size in enumerate(sizes, 1))))
    return PlotView(
        title="Deviation per held-out pose, mm",
        x_label="held-out pose",
        series=tuple(series),
        is_logarithmic=True,
        note="No held-out pose is measured yet.",
    )


def residual_plot(picture: RunPicture) -> PlotView:
    """Each record less what was predicted before it, in standard deviations of that; the largest axis."""
    found = []
    for number, sample in enumerate(picture.state.samples(Phase.IDENTIFY), start=1):
        expected = picture.expected.get((sample.at, sample.orientation))
        if expected is None or sample.orientation == 1:
            continue
        pairs = zip(sample.deviation_mm, expected.deviation_mm, expected.sigma_mm, strict=True)
        scaled = [(measured - predicted) / sigma for measured, predicted, sigma in pairs if sigma > 0.0]
        found.append((float(number), max(scaled, key=abs, default=0.0)))
    return PlotView(
        title="Residual per record, sigma",
        x_label="record",
        series=(Series("largest of x, y, z", "o", tuple(found)),),
        level=0.0,
        note="No record beside a reference is taken yet.",
    )


def rollback_question(run: str, *, is_in_controller: bool) -> QuestionView:
    """What a person confirms before the controller's config is changed."""
    title = f"Go back to the controller's config that {run} wrote?"
    if is_in_controller:
        title = f"Undo {run}: restore the previous config of the controller?"
    consent = Choice("y", "yes, replace the config, bit for bit", PERSON, is_consent=True)
    return QuestionView(title, (), "Press y or n.", (consent, Choice("n", "no, leave it as it is", None)))
