"""What is told of a run that nobody watched."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from hexacell.cell.fields import Frozen, Name, Text
from hexacell.cell.notifications import Occasion
from hexacell.verdict.decision import Verdict


class Notice(Frozen):
    """One run, as others are told of it; has no secret. Lengths in mm.

    Attributes:
        version: of this document; keys are only added within one.
        id: the same each time that the same end of the same run is told, so that who has it can tell.
        host: the computer that the cell is run from.
        run: the name of the run folder; none where none began.
        at: when the run ended, UTC.
        line: everything in one line.
        changed_leg: the leg that an alarm names.
        due_at: when the next calibration is due, where the cell file says how long one is valid.
    """

    version: Literal[1] = 1
    id: str
    cell: Name
    host: str
    run: str | None
    mode: str
    at: datetime
    occasions: tuple[Occasion, ...]
    exit_code: int
    line: str
    verdict: Verdict | None = None
    position_mm: float | None = None
    expanded_mm: float | None = None
    limit_mm: float | None = None
    changed_leg: int | None = None
    due_at: datetime | None = None

    @property
    def title(self) -> Text:
        """A subject for mail and chat."""
        return f"hexacell: {self.cell}: {', '.join(self.occasions)}"


class PendingNotice(Frozen):
    """A notice, and the name of whom it is still to be told."""

    to: Name
    notice: Notice
