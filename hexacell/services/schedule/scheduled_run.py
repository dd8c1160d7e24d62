"""What a scheduler is to start, and when."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from hexacell.errors import UsageError

_TIME = re.compile(r"([01][0-9]|2[0-3]):([0-5][0-9])")
MOST_MINUTES = 24 * 60


@dataclass(frozen=True, slots=True)
class ScheduledRun:
    """A run of a cell that begins at the same time each day.

    Attributes:
        cell: the cell file, absolute.
        name: of the cell.
        program: the words that start hexacell, absolute.
        mode: ``check``, ``quick`` or ``optimise``.
        hour, minute: when it begins, in the computer's time zone.
        longest_minutes: after so long it is ended in place, and can be resumed.
        retry_minutes: so long after a failure that may pass (a device, the lock) it is tried again.
        retries: how often.
        writable: the folders that it writes into: of the cell, of the controller's config, of metrics.
        metrics: the file that they are written to after each run; none without.
    """

    cell: Path
    name: str
    program: tuple[str, ...]
    mode: str
    hour: int
    minute: int
    longest_minutes: int
    retry_minutes: int
    retries: int
    writable: tuple[Path, ...]
    metrics: Path | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """The command and its arguments."""
        return (*self.program, "run", str(self.cell), "--unattended", "--mode", self.mode)

    @property
    def words_afterwards(self) -> tuple[str, ...]:
        """The command that writes the metrics; none without."""
        if self.metrics is None:
            return ()
        return (*self.program, "status", str(self.cell), "--metrics", str(self.metrics))

    @property
    def unit(self) -> str:
        """The name of its units, without their kind."""
        plain = re.sub(r"[^A-Za-z0-9]+", "-", self.name).strip("-").lower()
        return f"hexacell-{plain or 'cell'}"


def time_of_day(text: str) -> tuple[int, int]:
    """Hour and minute.

    Raises:
        UsageError: it is no time of day.
    """
    found = _TIME.fullmatch(text)
    if found is None:
        raise UsageError(f"'{text}' is no time of day", action="Write it as 02:30")
    return int(found[1]), int(found[2])
