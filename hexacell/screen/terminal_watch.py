"""The end of a terminal is the end of the screen at it, at once.

What is drawn then can be written nowhere: Textual's queue of it fills, and the process would wait for ever.
Its run notices that nobody is there, and pauses.
"""

from __future__ import annotations

import os
import select
import threading

from hexacell.errors import ExitCode


def end_with_terminal(terminal: int) -> None:
    """End this process as soon as a terminal is gone, whether or not a signal says so."""
    threading.Thread(target=_wait_and_end, args=(terminal,), daemon=True).start()


def _wait_and_end(terminal: int) -> None:
    waiting = select.poll()
    waiting.register(terminal, 0)  # a hang-up is told even where nothing is asked for
    waiting.poll()
    os._exit(int(ExitCode.INTERRUPTED))
