"""Text for the events of a run: what the run does now, and what just happened.

A step and its events have their own words (:mod:`procedures.steps`). Those whose text is more than a line
have it here.
"""

from __future__ import annotations

from hexacell.campaign.decisions import Forecast
from hexacell.text.layout import wrapped
from hexacell.text.measured_noise import measured_noise_text
from hexacell.text.planning import quick_accuracy_text, quick_start_text, run_forecast_line
from hexacell.text.verdict import check_start_text, check_text, length_text, verification_text
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
from procedures.steps import events
from procedures.steps.move import Move


class EventFormatter:
    """Turns the events of one run, in their order, into lines of text."""

    def __init__(self) -> None:
        self._forecast: Forecast | None = None

    def lines(self, event: events.Event, state: RunState) -> list[str]:
        """Text of an event; ``state`` includes the event. Empty where there is nothing to report."""
        return [text for text in (event_text(event, state), self._forecast_line(event)) if text]

    def _forecast_line(self, event: events.Event) -> str | None:
        """The predicted error, once the set whose last move predicted it is closed."""
        match event:
            case events.StepBegun(step=Move(expected=expected)) if expected is not None:
                self._forecast = expected.forecast
            case events.SetClosed(at=SetKey(phase=Phase.IDENTIFY)) if self._forecast is not None:
                return run_forecast_line(self._forecast)
        return None


def activity(event: events.Event) -> str | None:
    """A few words on what the run does from this event on; None where that does not change."""
    return event.step.activity() if isinstance(event, events.StepBegun) else None


def event_text(event: events.Event, state: RunState) -> str | None:
    """What an event reports, if anything; ``state`` includes the event."""
    match event:
        case events.RunStarted():
            return _start_text(event)
        case events.NoiseMeasured():
            return _noise_text(event, state)
        case events.Identified():
            return None if event.quick is None else quick_accuracy_text(event.quick)
        case events.ResultValidated():
            return _verdict_text(event)
    text = event.text(state)
    return None if text is None else "\n".join(wrapped(line, indent=2) for line in text.splitlines())


def _start_text(started: events.RunStarted) -> str | None:
    """What a check or the quick level starts from."""
    if started.mode in {"quick", "optimise"}:
        return quick_start_text(started.accepted) if started.mode == "quick" else None
    return check_start_text(started.accepted)


def _noise_text(measured: events.NoiseMeasured, state: RunState) -> str:
    """The noise, and what else was read meanwhile."""
    text, pilots = measured_noise_text(measured.noise, with_averaging=True), state.set(measured.at).pilots
    if not pilots:
        return text
    meanwhile = f"meanwhile {len(pilots)} pilot poses were read, by which the next ones are chosen"
    return f"{text}\n{wrapped(meanwhile, indent=2)}"


def _verdict_text(judged: events.ResultValidated) -> str | None:
    """The verdict of a calibration, of a length check, or of a check."""
    if judged.verification is not None:
        return verification_text(judged.verification)
    if judged.length is not None:
        return length_text(judged.length)
    return None if judged.check is None else check_text(judged.check)
