"""The review of a run: its verdict, what follows from it, its parameters, and how it came about."""

from typing import Any

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.text.config_changes import pending_text
from hexacell.text.line_face import whole_event_text
from hexacell.text.parameters import rows_of_run
from hexacell.text.screens.banner import verdict_urgency
from hexacell.text.screens.measuring import SUSPICIOUS_SIGMAS, accuracy_plot, off_of, residuals_of
from hexacell.text.screens.questions import PERSON, approval_refusal, yes_or_no
from hexacell.text.screens.run_picture import RunPicture
from hexacell.text.screens.views import Line, PlotView, QuestionView, Row, Series, Urgency
from hexacell.text.verdict import VERDICT_MEANINGS, teaching_sentence
from hexacell.verdict.verification import DeviationStatistics
from procedures.run.keys import Phase
from procedures.run.questions import PendingChange, WrittenResult
from procedures.run.state import RunState

PROPOSAL_WAITS = "Its proposal can still be written: w asks for it, with the change."

FRAMES = (
    "The config's numbers are in the frames that move your taught points least. What changed, and its "
    "sigma, are in others ({frame}), where a choice of frames is no change."
)


def review_lines(picture: RunPicture, *, may_write: bool = False) -> tuple[Line, list[Line], list[Line]]:
    """The verdict in words, what follows from it, and what it is of.

    ``may_write`` is whether this is a recorded run whose proposal can be written.
    """
    state = picture.state
    verdict = ("No verdict yet: it is given once the held-out poses are measured.", Urgency.CALM)
    if state.verdict is not None:
        verdict = (
            f"{state.verdict.upper()}: {VERDICT_MEANINGS[state.verdict]}",
            verdict_urgency(state.verdict),
        )
    moved = teaching_sentence(state.proposed.displacement) if state.proposed is not None else ""
    approval = f"{_approval(picture)} {PROPOSAL_WAITS}" if may_write else _approval(picture)
    waits = picture.question is not None or may_write
    consequences = [(approval, Urgency.ATTENTION if waits else Urgency.CALM), (moved, Urgency.CALM)]
    scope = [(line, Urgency.CALM) for line in (*_scope(state), *_comparison(state))]
    return verdict, [line for line in consequences if line[0]], scope


def change_text(picture: RunPicture) -> str:
    """The change of the controller's config that waits for approval."""
    subject = picture.question and picture.question.subject
    return pending_text(subject) if isinstance(subject, PendingChange) else "No change waits for approval."


def parameter_cells(state: RunState, settings: CellSettings | None) -> tuple[Row, ...]:
    """A row for each parameter, with the config's numbers where these are known."""
    written: dict[str, tuple[str, str]] = {}
    rows = rows_of_run(state, settings)
    if state.proposed is not None and state.started is not None and settings is not None:
        every = settings.mechanism.parameters
        now, new = (every.vector(one) for one in (state.started.controller, state.proposed.written))
        known = {one.name: one for one in rows}
        for at, parameter in enumerate(every.parameters):
            if (row := known.get(parameter.name)) is not None:
                written[parameter.name] = row.figure(float(now[at])), row.figure(float(new[at]))
    return tuple(
        Row(
            one.name,
            (
                one.label,
                *written.get(one.name, (one.figure(one.old), one.figure(one.new))),
                one.figure(one.change, "+"),
                one.figure(one.sigma),
                f"  {one.meaning}",
            ),
        )
        for one in rows
    )


def frames_note(state: RunState) -> str:
    """In which frames the parameters are shown."""
    if state.identified is None:
        return "The geometry is not identified yet."
    return FRAMES.format(frame=state.identified.result.frame) if state.proposed is not None else ""


def _scope(state: RunState) -> tuple[str, ...]:
    """Scope of the verdict, without the verdict itself, which stands above it."""
    if state.judged is None:
        return ("The length scale was not checked.",) if state.identified else ()
    lines = (whole_event_text(state.judged, state) or "").splitlines()
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
        return "The old config was restored: the robot errs as before."
    if state.committed is not None:
        return f"Written to the controller, approved by {state.committed.approved_by}."
    if state.proposed is not None:
        failed = [gate.sentence for gate in state.proposed.gates if not gate.passed]
        return f"Not approved. {' '.join(failed)}".strip()
    missing = "the held-out poses with the old geometry are still to be measured"
    if state.identified is None:
        missing = "the geometry is not identified"
    is_check = state.started is not None and state.started.mode not in {"quick", "optimise"}
    nothing = "Nothing is to be approved: this run changes nothing."
    return nothing if is_check else f"Approving is not possible yet: {missing}."


def _comparison(state: RunState) -> tuple[str, ...]:
    """Mean and largest distance of the ball from its reference, with the old and the new geometry."""
    rows = []
    for name, phase in (("before", Phase.BEFORE), ("after", Phase.AFTER)):
        deviations = state.held_out(phase)
        if (found := DeviationStatistics.of(deviations)) is not None:
            largest = float(np.linalg.norm(deviations, axis=-1).max())
            sizes = f"mean {found.mean_mm:.3f}, largest {largest:.3f} mm"
            rows.append(f"{found.poses} held-out poses {name}: {sizes}")
    return tuple(rows)


def deviation_plot(state: RunState) -> PlotView:
    """The ball's distance from its reference at each held-out pose, as figures 8 and 9 of the paper."""
    series = []
    for name, marker, phase in (("before", "o", Phase.BEFORE), ("after", "x", Phase.AFTER)):
        sizes = (max(float(np.linalg.norm(one)), 1e-4) for one in state.held_out(phase))
        series.append(Series(name, marker, tuple((float(n), size) for n, size in enumerate(sizes, 1))))
    return PlotView(
        title="Held-out deviation, mm",
        x_label="held-out pose",
        series=tuple(series),
        is_logarithmic=True,
        note="No held-out pose is measured yet.",
    )


def residual_plot(picture: RunPicture) -> PlotView:
    """By how many standard deviations each record is off the fit, or before it off what was predicted."""
    samples = enumerate(picture.state.samples(Phase.IDENTIFY), start=1)
    of_fit = residuals_of(picture)
    found = [(float(number), off_of(picture, sample, of_fit)) for number, sample in samples]
    known = tuple((number, off[1]) for number, off in found if off is not None)
    return PlotView(
        title="Residual, sigma",
        x_label="record",
        series=(Series("largest axis", "o", known),),
        level=SUSPICIOUS_SIGMAS,
        level_name=f"{SUSPICIOUS_SIGMAS:g} sigma",
        note="No record beside a reference is taken yet.",
    )


def parts(picture: RunPicture, settings: CellSettings, *, may_write: bool) -> dict[str, tuple[Any, ...]]:
    """All parts of a result, by their names; ``may_write``: whether the run may still be written."""
    verdict, consequences, scope = review_lines(picture, may_write=may_write)
    return {
        "verdict": verdict,
        "consequences": (consequences,),
        "scope": (scope,),
        "frames": (frames_note(picture.state),),
        "parameters": (parameter_cells(picture.state, settings),),
        "change": (change_text(picture),),
        "plot-deviation": (deviation_plot(picture.state),),
        "plot-residual": (residual_plot(picture),),
        "plot-accuracy": (accuracy_plot(picture, settings.acceptance.position_mm),),
    }


def rollback_question(run: str, *, is_in_controller: bool) -> QuestionView:
    """What a person confirms before the controller's config is changed."""
    title = f"Restore the controller's config that {run} wrote?"
    follows = "The robot then errs as after that run; what drifted since is not corrected."
    if is_in_controller:
        title = f"Undo {run}: restore the previous config of the controller?"
        follows = "The errors that this run corrected return."
    reload = "The controller has to read the file anew: restart or reload it then, before anything moves."
    yes = "yes, replace the config, bit for bit", PERSON
    return yes_or_no(title, (follows, reload), yes, ("no, leave it as it is", None))
