"""A run that a scheduler started: refused in quiet hours, and tried again within its window."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from hexacell.cli.console import Console
from hexacell.cli.signal_commands import SignalCommands
from hexacell.errors import HexacellError
from hexacell.services.run.calibration_run import RunRequest
from hexacell.services.schedule.unattended_runs import local_now, refuse_quiet_hours, refused_start
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
            refused = refused_start(request, error, began, local_now())
            if refused.wait_s is None:
                raise
            console.warn(next_try_text(error, refused.wait_s))
            SignalCommands(console).run(asyncio.sleep(refused.wait_s))
