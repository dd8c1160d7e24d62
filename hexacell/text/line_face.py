"""Text for a plain terminal: what to type, where a run is, and what happens in it.

A step and its events have their own words (:mod:`procedures.steps`); those whose text is more than a line
have it here.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from hexacell.campaign.decisions import Forecast
from hexacell.lengths import unit_of
from hexacell.text.layout import COLUMNS, duration, wrapped
from hexacell.text.measured_noise import measured_noise_text, reversal_sentence, worsening_sentence
from hexacell.text.planning import quick_accuracy_sentences, run_forecast_line
from hexacell.text.terms import run_terms_text
from hexacell.text.verdict import check_text, length_text, verification_text
from procedures.journal.journal import Entry
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, apply
from procedures.steps import events
from procedures.steps.move import Move

if TYPE_CHECKING:
    from hexacell.run_process.live_snapshot import GaugeSnapshot, LiveSnapshot

INDENT = 10
"""Width of the column with the time."""

LETTERS = (
    "Letters, each with Enter: p pause after this record, P at once, r resume,\n"
    "u undo the last record, m measure this point again (m 3: its record 3),\n"
    "g what the gauges show, s where the run is, a abort."
)


def record_text(record: events.RecordTaken) -> str:
    """A record in a line: where, and how far the ball was from the point's reference."""
    x, y, z = record.deviation_mm
    where = f"{record.at.name}, orientation {record.orientation}"
    return f"{where}: x {x:+.3f}, y {y:+.3f}, z {z:+.3f} mm"


def gauges_text(snapshot: LiveSnapshot) -> str:
    """What the devices show now, a line each."""
    lines = [_gauge_text(gauge) for gauge in snapshot.gauges]
    if (sample := snapshot.encoders.value) is not None:
        positions = " ".join(f"{position:.3f}" for position in sample.positions)
        lines.append(f"encoders: {positions} {sample.unit}")
    if snapshot.stop_reason:
        lines.append(f"motion is forbidden: {snapshot.stop_reason}")
    return "\n".join(wrapped(line, indent=2) for line in lines)


def _gauge_text(gauge: GaugeSnapshot) -> str:
    if gauge.problem:
        return gauge.problem
    if gauge.shown_mm is None or gauge.age_s is None:
        return f"gauge {gauge.name}: not read yet"
    noise = "" if gauge.noise_mm is None else f", noise {1000.0 * gauge.noise_mm:.1f} um"
    shown = f"gauge {gauge.name}: {gauge.shown_mm:+.3f} {gauge.unit}, {gauge.age_s:.1f} s ago{noise}"
    if gauge.middle_mm is None:
        return shown
    beside = gauge.shown_mm - gauge.middle_mm
    return f"{shown}; {beside:+.2f} from mid travel ({gauge.travel_mm:g} {gauge.unit})"


class EventFormatter:
    """Turns the events of one run, in their order, into lines of text; and says where the run is."""

    def __init__(self) -> None:
        self._state = RunState()
        self._doing: str | None = None
        self._last: events.RecordTaken | None = None
        self._forecast: Forecast | None = None

    def lines(self, event: events.Event, state: RunState) -> list[str]:
        """Text of an event; ``state`` includes the event. Empty where there is nothing to report."""
        self._state, self._doing = state, activity(event) or self._doing
        forecast = None
        match event:
            case events.RecordTaken():
                self._last = event
            case events.StepBegun(step=Move(expected=expected)) if expected is not None:
                self._forecast = expected.forecast
            case events.SetClosed(at=SetKey(phase=Phase.IDENTIFY)) if self._forecast is not None:
                # Of the move before it, which predicted the error with this set.
                forecast = wrapped(run_forecast_line(self._forecast), indent=2)
        return [text for text in (event_text(event, state), forecast) if text]

    def story(self, event: events.Event, state: RunState) -> str:
        """The same for whoever sees nothing else of the run: records and its end too."""
        return "\n".join([*_own_words(event), *self.lines(event, state)])

    def status_text(self, expected: int) -> str:
        """Where the run is: what it does, how far it is, its last record, its accuracy and the time left.

        ``expected`` is how many records and closings of points are planned.
        """
        done = self._state.completed
        lines = [
            f"Now: {self._doing or 'connecting'}",
            f"Done: {done} of {max(expected, done)} records and closings of points",
        ]
        if self._last is not None:
            lines.append(f"Last record: {record_text(self._last)}")
        if (forecast := self._forecast) is not None:
            left = f", {duration(forecast.minutes)} left" if forecast.minutes > 0.0 else ""
            unit = unit_of(forecast.now_mm, forecast.end_mm)
            errors = f"{unit.length(forecast.now_mm)} now, {unit.length(forecast.end_mm)} at the end"
            lines.append(f"Predicted error at the task: {errors}{left}")
        return "\n".join(wrapped(line, indent=2) for line in lines)


def activity(event: events.Event) -> str | None:
    """A few words on what the run does from this event on; None where that does not change."""
    return event.step.activity() if isinstance(event, events.StepBegun) else None


def event_text(event: events.Event, state: RunState) -> str | None:
    """What an event reports, if anything, in lines that fit a terminal; ``state`` includes the event."""
    text = whole_event_text(event, state)
    return None if text is None else "\n".join(wrapped(line, indent=2) for line in text.splitlines())


def whole_event_text(event: events.Event, state: RunState) -> str | None:
    """What an event reports, in lines of any length."""
    match event:
        case events.RunStarted(mode=mode, accepted=accepted):
            what = "quick level" if mode == "quick" else "check"
            begun = f"no accepted result has the controller's config: the {what} starts from the drawing"
            if accepted is not None:
                name = Path(accepted.run).name
                begun = f"the {what} starts from the result of {accepted.at:%Y-%m-%d}, {name}"
            return None if mode == "optimise" else begun
        case events.NoiseMeasured():
            noise = measured_noise_text(event.noise, with_averaging=True)
            pilots = len(state.set(event.at).pilots)
            meanwhile = f"meanwhile {pilots} preliminary poses were read, by which the next ones are chosen"
            return f"{noise}\n{meanwhile}" if pilots else noise
        case events.Identified(quick=quick, reversal=reversal, worsening=worse):
            known = "" if quick is None else f"quick level: {quick_accuracy_sentences(quick)}"
            found = "" if reversal is None else reversal_sentence(reversal)
            worsened = "" if worse is None else worsening_sentence(worse)
            return "\n".join(filter(None, [known, found, worsened])) or None
        case events.ResultValidated():
            if event.verification is not None:
                found = f"  {run_terms_text(state)}".rstrip()
                return "\n".join(filter(None, [verification_text(event.verification), found]))
            check = None if event.check is None else check_text(event.check)
            return check if event.length is None else length_text(event.length)
    return event.text(state)


def run_story(entries: Iterable[Entry]) -> Iterator[tuple[Entry, str]]:
    """The events that are worth telling a person, each with its text, which may have several lines."""
    formatter, state = EventFormatter(), RunState()
    for entry in entries:
        state = apply(state, entry.event)
        if text := formatter.story(entry.event, state):
            yield entry, text


def story_text(entries: Iterable[Entry]) -> str:
    """What happened in a run, each line with its time, UTC."""
    return "\n".join(f"{entry.at:%H:%M:%S}  {_indented(text)}" for entry, text in run_story(entries))


def _own_words(event: events.Event) -> list[str]:
    """Events that are not reported while they happen."""
    match event:
        case events.RunStarted():
            return [f"{event.mode} of {event.cell}, {event.software}"]
        case events.RecordTaken():
            return [record_text(event)]
        case events.Interrupted(reason=reason):
            return [f"interrupted: {reason}"]
        case events.Ended(line=line):
            return [line]
    return []


def _indented(text: str) -> str:
    lines = (textwrap.fill(line, COLUMNS - INDENT, subsequent_indent="  ") for line in text.splitlines())
    return "\n".join(lines).replace("\n", "\n" + " " * INDENT)
