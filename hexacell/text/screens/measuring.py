"""A run that is being measured: how far it is, its records, the predicted accuracy, faults in words."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from hexacell.campaign.decisions import Forecast
from hexacell.campaign.time_model import TimeModel
from hexacell.cell.model import CellSettings
from hexacell.lengths import from_to
from hexacell.results.result import RecordResidual
from hexacell.run_process.messages import HostFailed
from hexacell.text.layout import duration
from hexacell.text.screens.questions import RECOVERIES
from hexacell.text.screens.run_picture import RunPicture, Setback
from hexacell.text.screens.views import FaultView, PlotView, Row, Series, Urgency
from hexacell.uncertainty.statement import COVERAGE_FACTOR
from procedures.calibration.calibration import Mode
from procedures.run.keys import Phase, SetKey
from procedures.steps import events

RESUMABLE = "What was measured is kept. Mend what is to be mended, then r in 2 Preflight resumes the run."

PACE_RECORDS = 8
"""Number of the latest records whose pace counts."""

SUSPICIOUS_SIGMAS = 4.0
"""From so many standard deviations on a record is marked."""

PHASES = {
    Phase.IDENTIFY: "measuring",
    Phase.BEFORE: "held-out poses, old geometry",
    Phase.AFTER: "held-out poses, new geometry",
    Phase.CONFIRM: "confirming records",
    Phase.LENGTH: "length check",
}

LETTERS = {Phase.IDENTIFY: "", Phase.BEFORE: "b", Phase.AFTER: "a", Phase.CONFIRM: "c", Phase.LENGTH: "L"}
"""Before the names of records."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run is.

    Attributes:
        place: the point and the record that are measured, in words.
        done, planned: readings taken and planned; 0 planned where that is not known.
    """

    place: str
    done: int
    planned: int


def progress(picture: RunPicture, settings: CellSettings | None) -> Progress:
    """How far a run is, in words and readings."""
    done, planned = readings(picture)
    if (at := picture.at) is None or settings is None:
        return Progress("", done, planned)
    held_out = settings.verification
    planned_at = {Phase.BEFORE: held_out.compared, Phase.AFTER: held_out.afterwards}
    plan = settings.identification if at.phase is Phase.IDENTIFY else held_out
    taken = len(picture.state.set(at).samples)
    points, records = len(plan.points), max(planned_at.get(at.phase, plan.orientations), taken)
    place = f"{PHASES[at.phase]}: point {at.point} of {points}, record {max(1, taken)} of about {records}"
    if at.phase is Phase.LENGTH:
        place = f"{PHASES[at.phase]}: mounting {at.point}"
    if planned:
        place += f"; reading {done} of {planned} of the run"
    return Progress(place, done, planned)


def remaining(picture: RunPicture, settings: CellSettings | None) -> str:
    """How long the run still takes, and how many readings that is at most; empty if nothing is known."""
    done, planned = readings(picture)
    if (left := planned - done) <= 0:
        return f"{done} readings so far" if done and planned <= 0 else ""
    minutes = _minutes(picture, settings, left)
    about = "" if minutes is None else f"About {duration(minutes)}, "
    return f"{about}at most {left} readings left"


def readings(picture: RunPicture) -> tuple[int, int]:
    """How many readings are taken, closings of sets included, and how many are planned; 0 if not known."""
    done = sum(len(measured.samples) + measured.closed for measured in picture.state.sets.values())
    return done, picture.described.expected_records if picture.described else 0


def _minutes(picture: RunPicture, settings: CellSettings | None, left: int) -> float | None:
    """By the median of the latest readings, else by what the cell file states; None without either."""
    recent = picture.record_times[-PACE_RECORDS - 1 :]
    gaps = [(later - earlier).total_seconds() / 60.0 for earlier, later in pairwise(recent)]
    if settings is None:
        return left * median(gaps) if gaps else None
    stated = TimeModel.of(settings)
    a_reading = median(gaps) if gaps else stated.record_s / 60.0
    return left * a_reading + _stations_left(picture, settings) * stated.place_s / 60.0


def _stations_left(picture: RunPicture, settings: CellSettings) -> int:
    """How often somebody still has to place the gauges in a calibration; 0 in other runs."""
    if picture.described is None or picture.described.mode != Mode.OPTIMISE.value:
        return 0
    begun = picture.state.sets
    points = {phase: len(settings.verification.points) for phase in (Phase.BEFORE, Phase.AFTER)}
    points[Phase.IDENTIFY] = len(settings.identification.points)
    return sum(max(0, points[phase] - sum(at.phase is phase for at in begun)) for phase in points)


def records_by_name(picture: RunPicture) -> dict[str, events.RecordTaken]:
    """The records by the names that people read, in the order in which they were taken."""
    every = (sample for measured in picture.state.sets.values() for sample in measured.samples)
    return {f"{LETTERS[one.at.phase]}{one.at.point}/{one.orientation}": one for one in every}


def record_rows(picture: RunPicture) -> tuple[Row, ...]:
    """A row for each record."""
    rows, of_fit = [], residuals_of(picture)
    for name, sample in records_by_name(picture).items():
        values = tuple(f"{value:+.3f}" for value in sample.deviation_mm)
        shown, urgency = ("ref." if sample.orientation == 1 else "", ""), Urgency.CALM
        if (off := off_of(picture, sample, of_fit)) is not None:
            is_far = off[1] > SUSPICIOUS_SIGMAS
            shown = f"{off[0]:+.3f}", f"{off[1]:.1f}{' !' if is_far else ''}"
            urgency = Urgency.ATTENTION if is_far else Urgency.CALM
        rows.append(Row(name, (name, *values, *shown), urgency))
    return tuple(rows)


def residuals_of(picture: RunPicture) -> Mapping[tuple[SetKey, int], RecordResidual]:
    """What the fit leaves of each record, by set and orientation; empty before it."""
    residuals = () if picture.state.identified is None else picture.state.identified.residuals
    return {(SetKey(phase=Phase.IDENTIFY, point=one.point), one.orientation): one for one in residuals}


def off_of(
    picture: RunPicture, sample: events.RecordTaken, of_fit: Mapping[tuple[SetKey, int], RecordResidual]
) -> tuple[float, float] | None:
    """By how much a record is off, mm, at its largest axis, and how many sigma that is; if it is known.

    Off the fit, once there is one; before, and of records that are not in it, off what was predicted.
    """
    if sample.orientation == 1:
        return None
    if (residual := of_fit.get((sample.at, sample.orientation))) is not None:
        return max(residual.mm, key=abs), residual.sigmas
    if (expected := picture.expected.get((sample.at, sample.orientation))) is None:
        return None
    pairs = zip(sample.deviation_mm, expected.deviation_mm, expected.sigma_mm, strict=True)
    found = [(measured - predicted, sigma) for measured, predicted, sigma in pairs]
    off, sigma = max(found, key=lambda pair: abs(pair[0]))
    return off, abs(off) / sigma if sigma else 0.0


def _now_and_end(forecast: Forecast) -> tuple[float, float]:
    """U now and at the end, mm; by the records alone where the systematic effects are not known."""
    now, end = (
        forecast.expanded_mm(one) or COVERAGE_FACTOR * one for one in (forecast.now_mm, forecast.end_mm)
    )
    return now, end


def accuracy_plot(picture: RunPicture, limit_mm: float | None) -> PlotView:
    """U at the worst task pose against the records, and what is still expected."""
    known = [(float(records), *_now_and_end(forecast)) for records, forecast in picture.forecasts]
    series = [Series("so far", "o", tuple((records, now) for records, now, _ in known))]
    title = "U at the task, mm"
    if known:
        records, now, end = known[-1]
        title = f"U at the task {from_to(now, end)}"
        if picture.state.identified is None:
            left = picture.forecasts[-1][1].records
            series.append(Series("at the end", "x", ((records + left, end),) if left else ()))
    return PlotView(
        title=title,
        x_label="records",
        series=tuple(series),
        level=limit_mm,
        level_name="" if limit_mm is None else f"limit {limit_mm:g} mm",
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
            does = (
                f"Nothing: {RECOVERIES.get(action.value, action.value)} is under way (attempt {attempt})."
            )
            return FaultView("A step failed, the robot was stopped", reason, does)
        case events.Interrupted(reason=reason):
            return FaultView("The run ended early", reason, RESUMABLE)
        case HostFailed(problem=problem, action=action, exit_code=exit_code):
            title = "That was refused" if exit_code is None else "The run could not go on"
            return FaultView(title, problem, action)
