"""What a person at a plain terminal may ask during a run."""

from __future__ import annotations

from hexacell.campaign.decisions import Forecast
from hexacell.text.events import activity
from hexacell.text.line_face import run_status_text
from procedures.engine.command_loop import Status
from procedures.run.state import RunState
from procedures.steps import events
from procedures.steps.move import Move


class RunStatus:
    """A listener that remembers where the run is; ``status`` is the engine's, where that is known."""

    def __init__(self, expected_records: int) -> None:
        self.status: Status | None = None
        self._expected = expected_records
        self._state = RunState()
        self._doing: str | None = None
        self._last: events.RecordTaken | None = None
        self._forecast: Forecast | None = None

    def __call__(self, event: events.Event, state: RunState) -> None:
        """Take one event."""
        self._state = state
        self._doing = activity(event) or self._doing
        match event:
            case events.RecordTaken():
                self._last = event
            case events.StepBegun(step=Move(expected=expected)) if expected is not None:
                self._forecast = expected.forecast or self._forecast

    def text(self) -> str:
        """Where the run is."""
        return run_status_text(
            self._doing, self._state, self._expected, self._last, self._forecast, self.status
        )
