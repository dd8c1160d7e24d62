"""A run that nobody watches: begun within its window, and people are notified afterwards."""

import asyncio
from collections.abc import Callable

from hexacell.cell.loader import Cell
from hexacell.cli.console import Console
from hexacell.cli.terminal import SignalCommands
from hexacell.errors import FileError, HexacellError
from hexacell.services.history.cell_status import cell_status, publish_status
from hexacell.services.notify.notice import RunEnd, notice_of_end, notice_of_failure
from hexacell.services.notify.outbox import notify_all
from hexacell.services.run.calibration_run import RunRequest
from hexacell.services.schedule.unattended_runs import local_now, refuse_quiet_hours, refused_start
from hexacell.text.operation import NEXT_TIME, notify_line
from hexacell.text.run import next_try_text
from procedures.steps import events


def begun_in_window(
    request: RunRequest, console: Console, begin: Callable[[], events.Ended]
) -> events.Ended:
    """Begin a run; where that is refused, note why, wait, and try again while its window is open.

    Raises:
        Interruption: a signal ended it.
        HexacellError: the last refusal, or what ended the run.
    """
    if not request.keeps_hours:
        return begin()
    began = local_now()
    while True:
        try:
            refuse_quiet_hours(request.cell.settings, local_now())
            return begin()
        except HexacellError as error:
            if request.folder.journal.is_file():
                raise  # it had begun: its journal says the rest
            wait_s = refused_start(request, error, began, local_now())
            if wait_s is None:
                raise
            console.warn(next_try_text(error, wait_s))
            SignalCommands(console).run(asyncio.sleep(wait_s))


def notified_afterwards(request: RunRequest, console: Console, run: Callable[[], RunEnd]) -> RunEnd:
    """Carry out an unattended run, then notify people of its end, or of the error that ended it.

    The outcome of the run stays what it is, whatever goes wrong here.
    """
    try:
        end = run()
    except Exception as error:
        _notify(request, console, error)
        _publish(request.cell, console)
        raise
    _notify(request, console, end)
    _publish(request.cell, console)
    return end


def _publish(cell: Cell, console: Console) -> None:
    """Put the state of the cell into the archive that it shares; warn in one line where that fails."""
    if cell.settings.archive.url is None:
        return
    try:
        publish_status(cell_status(cell))
    except FileError as error:
        console.warn(" ".join(str(error).split()))
    except Exception as fault:
        console.warn(f"the shared archive is as it was before this run ({type(fault).__name__})")


def _notify(request: RunRequest, console: Console, end: RunEnd | Exception) -> None:
    if not request.unattended or not request.cell.settings.notifications:
        return
    try:
        notice = notice_of_end(end) if isinstance(end, RunEnd) else notice_of_failure(request, end)
        line = notify_line(notify_all(request.cell, notice))
    except KeyboardInterrupt:
        line = f"not notified: interrupted ({NEXT_TIME})"
    except Exception as fault:
        line = f"not notified: a fault of the program ({type(fault).__name__})"
    if line is not None:
        console.warn(line)
