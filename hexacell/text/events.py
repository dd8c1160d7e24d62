"""Text for the events of a run: what the run does now, and what just happened."""

from __future__ import annotations

import numpy as np

from hexacell.campaign.decisions import Forecast
from hexacell.campaign.pilots import pilot_number
from hexacell.text.layout import wrapped
from hexacell.text.measured_noise import noise_and_averaging_text
from hexacell.text.planning import quick_accuracy_text, quick_start_text, run_forecast_line
from hexacell.text.verdict import check_start_text, check_text, length_text, verification_text
from procedures.run import events
from procedures.run.state import RunState
from procedures.run.steps import Compute, Move, Phase, Pilot, Probe, Repeat, SetKey, Standstill, Try

SET_NAMES = {
    Phase.IDENTIFY: "point {}",
    Phase.BEFORE: "held-out point {}, before",
    Phase.AFTER: "held-out point {}, after",
    Phase.CONFIRM: "held-out point {}, again",
    Phase.LENGTH: "length check, mounting {}",
}
COMPUTATIONS = {
    "assess noise": "evaluating the noise",
    "lend": "loading a provisional geometry",
    "take back": "restoring the controller's geometry",
    "identify": "identifying the geometry",
    "propose": "preparing the new config",
    "commit": "writing the config and reloading it",
    "judge": "verifying the result",
    "accept": "waiting for a decision on the result",
    "roll back": "restoring the old config",
}
CONFIG_CHANGES = {
    "lent": "the controller uses a provisional geometry while the points are measured",
    "taken back": "the controller uses its own geometry again",
    "rolled back": "the old geometry is back in the controller",
}


class EventFormatter:
    """Turns the events of one run, in their order, into lines of text."""

    def __init__(self) -> None:
        self._forecast: Forecast | None = None

    def lines(self, event: events.Event, state: RunState) -> list[str]:
        """Text of an event; ``state`` includes the event. Empty where there is nothing to report."""
        texts = (event_text(event, state), _why_few_records(event, state), self._forecast_line(event))
        return [text for text in texts if text]

    def _forecast_line(self, event: events.Event) -> str | None:
        """The predicted error, once the set whose last move predicted it is closed."""
        match event:
            case events.StepBegun(step=Move(expected=expected)) if expected is not None:
                self._forecast = expected.forecast
            case events.SetClosed(at=SetKey(phase=Phase.IDENTIFY)) if self._forecast is not None:
                return run_forecast_line(self._forecast)
        return None


def _why_few_records(event: events.Event, state: RunState) -> str | None:
    """Why a set was closed with fewer records than planned."""
    if not isinstance(event, events.SetClosed) or not event.reason:
        return None
    count = len(state.set(event.at).samples)
    return wrapped(f"{set_name(event.at)} ends with {count} records: {event.reason}", indent=2)


def set_name(key: SetKey) -> str:
    """Display name of a set: ``point 2``, ``held-out point 1, before``."""
    return SET_NAMES[key.phase].format(key.point)


def pose_name(key: SetKey, orientation: int) -> str:
    """Display name of a pose of a set: ``point 2, orientation 3``, ``point 1, pilot pose 2``."""
    pilot = pilot_number(orientation)
    pose = f"orientation {orientation}" if pilot is None else f"pilot pose {pilot}"
    return f"{set_name(key)}, {pose}"


def activity(event: events.Event) -> str | None:
    """A few words on what the run does from this event on; nothing where that does not change."""
    match event:
        case events.StepBegun(step=Standstill() | Repeat() as step):
            return f"{set_name(step.at)}, measuring the noise"
        case events.StepBegun(step=Probe() | Try() as step):
            return f"{set_name(step.at)}, trying the gauges"
        case events.StepBegun(step=Move() as step):
            return f"{pose_name(step.at, step.orientation)}{_forecast_range(step)}"
        case events.StepBegun(step=Pilot() as step):
            return pose_name(step.at, step.orientation)
        case events.StepBegun(step=Compute() as step):
            return COMPUTATIONS[step.kind]
        case _:
            return None


def _forecast_range(step: Move) -> str:
    """The predicted error now and at the end of the plan."""
    forecast = step.expected and step.expected.forecast
    return f": {forecast.now_mm:.3f} -> {forecast.end_mm:.3f} mm" if forecast else ""


def event_text(event: events.Event, state: RunState) -> str | None:
    """What an event reports, if anything."""
    match event:
        case events.Committed():
            return f"written to the controller, approved by {event.approved_by}"
        case events.ProvisionalApplied() | events.ProvisionalReverted() | events.RolledBack():
            return CONFIG_CHANGES[event.kind]
        case _:
            return _text_of_set(event, state) or _finding_text(event) or _further_text(event)


def _text_of_set(event: events.Event, state: RunState) -> str | None:
    """What was measured in a set, or could not be."""
    match event:
        case events.SetClosed():
            return set_summary(event, state)
        case events.SetInvalidated():
            return f"{set_name(event.at)} is measured again: {event.reason}"
        case events.RecordRejected():
            return f"{pose_name(event.at, event.orientation)} left out: {event.reason}"
        case events.NoiseMeasured():
            return _noise_text(event, state)
        case _:
            return None


def _basis_or_verdict(event: events.RunStarted | events.ResultValidated) -> str | None:
    """What a check starts from, and the verdict of any run."""
    if isinstance(event, events.RunStarted):
        quick = quick_start_text(event.accepted) if event.mode == "quick" else None
        return quick if event.mode in {"quick", "optimise"} else check_start_text(event.accepted)
    if event.verification is not None:
        return verification_text(event.verification)
    if event.length is not None:
        return length_text(event.length)
    return None if event.check is None else check_text(event.check)


def _finding_text(event: events.Event) -> str | None:
    """What a start, the quick level, a recall or a verdict reports."""
    match event:
        case events.RunStarted() | events.ResultValidated():
            return _basis_or_verdict(event)
        case events.Identified():
            return _identified_text(event)
        case events.RunRecalled():
            return f"the run is to end: {event.reason}; back to the reference"
        case events.ConfirmationPlanned():
            return confirmation_text(event)
        case _:
            return None


def _noise_text(measured: events.NoiseMeasured, state: RunState) -> str:
    """The noise, and what else was read meanwhile."""
    told, pilots = noise_and_averaging_text(measured.noise), len(state.set(measured.at).pilots)
    if not pilots:
        return told
    meanwhile = f"meanwhile {pilots} pilot poses were read, by which the next ones are chosen"
    return f"{told}\n{wrapped(meanwhile, indent=2)}"


def _identified_text(identified: events.Identified) -> str | None:
    """How well the quick level knows the robot."""
    return None if identified.quick is None else quick_accuracy_text(identified.quick)


def confirmation_text(planned: events.ConfirmationPlanned) -> str:
    """Why more is measured, and how much."""
    records = sum(map(len, planned.poses))
    return wrapped(f"{planned.reason}: {records} new records tell whether by chance", indent=2)


def _further_text(event: events.Event) -> str | None:
    """What an interruption, a failure or a command reports."""
    match event:
        case events.ReferenceConfirmed():
            return f"{set_name(event.at)} continues: its reference is unchanged"
        case events.RecordDiscarded():
            return f"{set_name(event.at)}, orientation {event.orientation} is measured again"
        case events.PoseExcluded():
            return f"{pose_name(event.at, event.orientation)}: {refusal_text(event)}"
        case events.Failed():
            reason = "\n".join(wrapped(line, indent=2) for line in event.reason.splitlines())
            return f"{reason}\n  attempt {event.attempt}: {event.action.value}"
        case events.CommandRejected():
            return f"{event.command}: {event.reason}"
        case _:
            return event.kind if isinstance(event, events.Paused | events.Resumed) else None


def refusal_text(event: events.PoseExcluded) -> str:
    """What follows from a pose that the controller refused."""
    if event.orientation == 1:
        return f"its reference is refused, the point is left out: {event.reason}"
    return f"the controller refuses this pose, which is not commanded again: {event.reason}"


def set_summary(closed: events.SetClosed, state: RunState) -> str:
    """One line about a closed set, at most 80 columns wide."""
    samples = state.set(closed.at).samples
    largest = max(float(np.abs(sample.deviation_mm).max()) for sample in samples)
    drift = float(np.abs(closed.drift_mm).max())
    return (
        f"{set_name(closed.at):24} {len(samples):2} records, "
        f"largest deviation {largest:.3f} mm, drift {drift:.3f} mm"
    )
