"""What the screens need of the world behind them. Nothing heavy is imported here."""

from __future__ import annotations

from enum import StrEnum
from typing import Protocol

from hexacell.text.screens.views import (
    CellView,
    ChecklistView,
    FaultView,
    HeaderView,
    HistoryView,
    MeasureView,
    PlanView,
    QuestionView,
    ReviewView,
)

RESUME = "resume"
"""In the place of a mode: go on with the latest run that was interrupted."""

WITH_LENGTH = "optimise with length check"
"""In the place of a mode: a calibration which checks the length scale before its verdict."""


ONCE = "once"
"""The plan is not tried again where it was, or is being tried."""


class ScreenAction(StrEnum):
    """What a person may ask for with one key."""

    PAUSE = "pause"
    PAUSE_AT_ONCE = "pause at once"
    UNDO = "undo"
    MEASURE_AGAIN = "measure again"
    ABORT = "abort"
    TAKE_CONTROL = "take control"
    CHECK = "check"
    START = "start"
    PREVIEW = "preview"
    EXCLUDE = "exclude"
    COMPARE = "compare"
    ROLL_BACK = "roll back"
    APPLY = "apply"
    OPEN = "open"
    DRIFT = "drift"
    STEP = "step"
    PLAY = "play"


class Backend(Protocol):
    """Everything behind the screens: the views to be shown, and what may be asked for.

    The views are those of this moment and cost a few milliseconds at most; what takes longer is awaited.
    """

    @property
    def question_number(self) -> int:
        """Counts the questions, so that none is taken for another."""
        ...

    @property
    def fault_number(self) -> int:
        """Counts the faults."""
        ...

    @property
    def runs_followed(self) -> int:
        """Counts the runs that were shown."""
        ...

    @property
    def may_leave_run(self) -> bool:
        """Whether a run goes on that can be stopped or left."""
        ...

    @property
    def proposing_run(self) -> str:
        """The recorded run in front, if its proposal can be applied; else empty."""
        ...

    def header(self) -> HeaderView:
        """The first line of every screen."""
        ...

    def cell(self) -> CellView:
        """The cell and its devices."""
        ...

    def checklist(self) -> ChecklistView:
        """What must hold before motion."""
        ...

    def plan(self) -> PlanView:
        """The poses of the plan, and what the cell file excludes."""
        ...

    def measure(self) -> MeasureView:
        """The run that is being measured."""
        ...

    def review(self) -> ReviewView:
        """The result."""
        ...

    def history(self) -> HistoryView:
        """The runs of the cell."""
        ...

    def question(self) -> QuestionView | None:
        """The question that waits, if one does."""
        ...

    def fault(self) -> FaultView | None:
        """The latest fault."""
        ...

    def allows(self, action: ScreenAction) -> bool:
        """Whether an action has an effect now."""
        ...

    async def perform(self, action: ScreenAction, argument: str = "") -> str:
        """Do what was asked for; what there is to say about it. Raises ``HexacellError``."""
        ...

    async def confirmation(self, action: ScreenAction, argument: str) -> QuestionView | None:
        """What a person must consent to before an action; none if to nothing. Raises ``HexacellError``."""
        ...

    async def answer(self, value: str | None) -> None:
        """Answer the question. Raises ``HexacellError``."""
        ...

    async def attend(self) -> None:
        """Follow the cell and its run until cancelled. Raises ``HexacellError``."""
        ...

    async def leave(self, *, keep_running: bool) -> None:
        """Let the run go on alone, or have it stopped. Raises ``HexacellError``."""
        ...
