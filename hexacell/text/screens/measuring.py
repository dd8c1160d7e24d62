"""Text for a run that is being measured: guidance, records with residuals, and the predicted accuracy."""

from itertools import pairwise
from statistics import median

from hexacell.cell.model import CellSettings
from hexacell.lengths import from_to
from hexacell.run_process.messages import HostFailed
from hexacell.text.layout import duration
from hexacell.text.screens.run_picture import RunPicture, Setback
from hexacell.text.screens.views import FaultView, PlotView, Series
from procedures.engine.command_loop import Status
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
from procedures.steps import events
from procedures.steps.base import StepOfSet
from procedures.steps.move import Expectation, Move
from procedures.steps.place import Place

NO_RUN = {
    "Now": "no run is being measured here",
    "Next": "look at 2 Preflight, and start a run from there",
    "Time": "-",
    "Stop": "nothing moves now",
}
AFTER_COMPUTING = {
    "identify": "the held-out poses are measured with the old geometry",
    "propose": "the change is shown in 4 Review and waits for approval",
    "commit": "the held-out poses are measured with the new geometry",
    "judge": "the verdict is shown in 4 Review",
}
"""What follows a step that moves nothing."""

PACE_RECORDS = 8
"""Number of the latest records whose pace gives the time that is left."""
RESUMED_THERE = "2 Preflight resumes it with r; what was measured is kept"
RESUMABLE = "What was measured is kept. Mend it, then press r in 2 Preflight, which resumes the run."


def guidance(picture: RunPicture, settings: CellSettings | None) -> dict[str, str]:
    """What happens now, what is next, how long it takes, and how to stop."""
    if picture.described is None:
        return NO_RUN
    return {
        "Now": _now(picture),
        "Next": _following(picture, settings),
        "Time": _remaining(picture),
        "Stop": _stopping(picture),
    }


def _now(picture: RunPicture) -> str:
    state, refusal = picture.state, picture.refusal
    if refusal is not None:
        return f"{refusal.command} was refused: {refusal.reason}"
    if state.ended is not None:
        return state.ended.line
    if picture.status is Status.ENDED:
        return f"ended early: {_reason(picture)}"
    if picture.question is not None:
        return (
            "a question waits for you" if picture.may_command else "a question waits for who is in control"
        )
    if picture.status is Status.PAUSED:
        return "paused: the robot stands still"
    pausing = ", then it pauses" if picture.status is Status.PAUSING else ""
    return f"{_doing(picture)}{pausing}"


def _reason(picture: RunPicture) -> str:
    match picture.setback:
        case events.Interrupted(reason=reason):
            return reason
        case HostFailed(problem=problem):
            return problem
        case _:
            return "its process is gone"


def _doing(picture: RunPicture) -> str:
    if (step := picture.step) is None:
        return "choosing the next pose"
    if isinstance(step, Move):
        name = step.at.name
        named = {0: f"a waypoint on the way to {name}", 1: f"the reference of {name}"}
        return f"moving to {named.get(step.orientation) or step.at.pose_name(step.orientation)}"
    doing = step.doing or step.kind
    return step.activity() or (f"{step.at.name}: {doing}" if isinstance(step, StepOfSet) else doing)


def _following(picture: RunPicture, settings: CellSettings | None) -> str:
    at, step = picture.at, picture.step
    if picture.state.ended is not None:
        return "look at 4 Review; 5 History has all runs"
    if picture.status is Status.ENDED:
        is_lost = isinstance(picture.setback, HostFailed) and picture.setback.evidence_lost
        return "2 Preflight begins a new run" if is_lost else RESUMED_THERE
    if picture.status is Status.PAUSED:
        return "it goes on where it was when you press p"
    if at is None or (step is not None and step.moves_nothing):
        return AFTER_COMPUTING.get("" if step is None else step.kind, "the next pose")
    if isinstance(step, Place):
        return "the reference is read, then the gauges are tried by small moves"
    return _after_set(picture.state, at, settings)


def _after_set(state: RunState, at: SetKey, settings: CellSettings | None) -> str:
    if settings is None:
        return "the next pose"
    is_identifying = at.phase is Phase.IDENTIFY
    plan = settings.identification if is_identifying else settings.verification
    points, taken = len(plan.points), len(state.set(at).samples)
    left = max(0, plan.orientations - taken)
    if left > 1:
        return f"{left} more records here, then the reference again"
    if at.point < points:
        by_hand = settings.stations.placement == "by-hand"
        place = "put the gauges around the ball at" if by_hand else "go on at"
        return f"the reference again, then {place} point {at.point + 1} of {points}"
    return "identifying the geometry" if is_identifying else "the next part of the run"


def _remaining(picture: RunPicture) -> str:
    done = sum(len(measured.samples) + measured.closed for measured in picture.state.sets.values())
    planned = picture.described.expected_records if picture.described else 0
    if picture.state.ended is not None:
        return f"done: {done} readings"
    if planned <= 0:
        return f"{done} readings so far"
    left = max(0, planned - done)
    recent = picture.record_times[-PACE_RECORDS - 1 :]
    gaps = [(later - earlier).total_seconds() / 60.0 for earlier, later in pairwise(recent)]
    about = f"about {duration(left * median(gaps))}: " if gaps else ""
    return f"{about}at most {left} of {planned} readings are left"


def _stopping(picture: RunPicture) -> str:
    described, control = picture.described, picture.control
    if described is not None and described.is_recorded:
        return "a recorded run: nothing moves; space plays, arrows step"
    if picture.state.ended is not None or picture.status is Status.ENDED:
        return "the run is over; nothing moves"
    if control is not None and not control.is_in_control:
        who = control.who or "nobody"
        return f"you only watch: {who} is in control; c takes over"
    if picture.status is Status.PAUSED:
        return "p goes on, a ends the run; all records are kept"
    return "p pauses after this record, P at once; a stops and ends; records are kept"


def record_lines(picture: RunPicture) -> tuple[str, ...]:
    """A line for each record, in the order in which they were taken."""
    lines = []
    for at, measured in picture.state.sets.items():
        phase = "" if at.phase is Phase.IDENTIFY else f"{at.phase.name.lower()} "
        for sample in measured.samples:
            name = f"{phase}{at.point}/{sample.orientation}"
            values = "".join(f"{value:+8.3f}" for value in sample.deviation_mm)
            residual = _residual(sample, picture.expected.get((at, sample.orientation)))
            lines.append(f"{name:12}{values}{residual}")
    return tuple(lines)


def _residual(sample: events.RecordTaken, expected: Expectation | None) -> str:
    """The largest difference from what was predicted, and how many sigma that is."""
    if sample.orientation == 1:
        return f"{'reference':>15}"
    if expected is None:
        return f"{'-':>9}{'-':>6}"
    pairs = zip(sample.deviation_mm, expected.deviation_mm, expected.sigma_mm, strict=True)
    found = [(measured - predicted, sigma) for measured, predicted, sigma in pairs]
    residual, sigma = max(found, key=lambda pair: abs(pair[0]))
    return f"{residual:+9.3f}{abs(residual) / sigma if sigma else 0.0:6.1f}"


def accuracy_plot(picture: RunPicture, target_mm: float | None) -> PlotView:
    """The predicted error at the worst task pose against the records, and what is still expected."""
    known = tuple((float(records), forecast.now_mm) for records, forecast in picture.forecasts)
    series = [Series("so far", "o", known)]
    if picture.forecasts and picture.state.identified is None:
        records, last = picture.forecasts[-1]
        coming = ((float(records + last.records), last.end_mm),) if last.records else ()
        series.append(Series("at the end", "x", coming))
    title = "Accuracy, as predicted"
    if picture.forecasts:
        last = picture.forecasts[-1][1]
        title = f"Accuracy {from_to(last.now_mm, last.end_mm).replace(' -> ', '->')}"
    return PlotView(
        title=title,
        x_label="records",
        series=tuple(series),
        level=target_mm,
        level_name="" if target_mm is None else f"target {target_mm:g} mm",
        is_logarithmic=True,
        note="Predicted from the second point on, once the records determine something.",
    )


def fault_view(setback: Setback) -> FaultView:
    """A fault in words."""
    match setback:
        case events.Tripped(guard=guard, device=device, problem=problem, action=action):
            where = f"{device}: " if device else ""
            return FaultView(f"Stopped by a guard: {guard.value}", f"{where}{problem}", action)
        case events.Failed(reason=reason, attempt=attempt, action=action):
            return FaultView(
                "A step failed, the robot was stopped",
                reason,
                f"The run does this now: {action.value} (attempt {attempt}).",
            )
        case events.Interrupted(reason=reason):
            return FaultView("The run ended early", reason, RESUMABLE)
        case HostFailed(problem=problem, action=action, exit_code=exit_code):
            title = "That was refused" if exit_code is None else "The run could not go on"
            return FaultView(title, problem, action)
