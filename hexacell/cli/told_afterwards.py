"""A run that nobody watches, and whoever is told of it afterwards. Its outcome stays what it is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from hexacell.cell.loader import Cell
from hexacell.cli.archive_argument import publish_or_warn
from hexacell.cli.console import Console
from hexacell.services.history.cell_status import cell_status
from hexacell.services.notify.notice import RunEnd, notice_of_end, notice_of_failure
from hexacell.services.notify.outbox import notify_all
from hexacell.services.run.calibration_run import RunRequest
from hexacell.text.notices import NEXT_TIME, notify_line


@dataclass
class RunNews:
    """What is told: the end of the last run, if there was one."""

    end: RunEnd | None = None


@contextmanager
def told_afterwards(request: RunRequest, console: Console) -> Iterator[RunNews]:
    """Tell, after an unattended run, what its ``end`` was set to, or what error ended it."""
    news = RunNews()
    try:
        yield news
    except Exception as error:
        _tell(request, console, news, error)
        _publish(request.cell, console)
        raise
    _tell(request, console, news, None)
    _publish(request.cell, console)


def _publish(cell: Cell, console: Console) -> None:
    """Put how the cell is now into the archive that it shares; whatever goes wrong is said in one line."""
    if cell.settings.archive.url is None:
        return
    try:
        publish_or_warn(cell_status(cell), console)
    except Exception as fault:
        console.warn(f"the shared archive is as it was before this run ({type(fault).__name__})")


def _tell(request: RunRequest, console: Console, news: RunNews, error: Exception | None) -> None:
    """Whatever goes wrong here is said in one line, and changes nothing else."""
    if not request.unattended or not request.cell.settings.notifications:
        return
    try:
        if error is not None:
            notice = notice_of_failure(request, error)
        elif news.end is not None:
            notice = notice_of_end(news.end)
        else:
            return
        line = notify_line(notify_all(request.cell, notice))
    except KeyboardInterrupt:
        line = f"not notified: interrupted ({NEXT_TIME})"
    except Exception as fault:
        line = f"not notified: a fault of the program ({type(fault).__name__})"
    if line is not None:
        console.warn(line)
