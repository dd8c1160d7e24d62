"""The events of a run for another program: the lines of its journal, copied as each of them lands.

The run never waits for who reads them. A target that cannot take a line is given up, and the run goes on.
"""

import errno
import os
from collections.abc import Callable
from pathlib import Path

from hexacell.errors import UsageError
from hexacell.storage.atomic_files import os_error_to_file_error
from hexacell.storage.output_files import EVENTS_MARK, OutputFile
from procedures.engine.engine import Listener
from procedures.run.state import RunState
from procedures.steps import events

CHUNK = 1 << 16


class EventStream:
    """Copies journals, each from its beginning, to a pipe or a file, where an earlier stream is replaced.

    ``warn`` is called once if the target takes no more. Raises ``UsageError`` for a pipe that nobody reads,
    ``FileError`` for a target that cannot be written.
    """

    def __init__(self, target: OutputFile, warn: Callable[[str], None]) -> None:
        self._target = target.path
        self._warn = warn
        self._descriptor: int | None = None
        try:
            self._descriptor = target.open_stream(waits=False)
        except OSError as error:
            if error.errno == errno.ENXIO and target.path.is_fifo():
                action = "Start its reader first"
                raise UsageError("nobody reads this pipe", subject=target.path, action=action) from error
            raise os_error_to_file_error("events cannot be written", target.path, error) from error

    def listener(self, journal: Path) -> Listener:
        """A listener for a run with this journal; the file need not exist yet."""
        copied = 0

        def listen(_: events.Event, __: RunState) -> None:
            nonlocal copied
            try:
                copied = self._copy(journal, copied)
            except OSError as error:
                self._warn(f"{self._target}: no more events are written there: {error.strerror}")
                self.close()

        return listen

    def close(self) -> None:
        """Write no more."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _copy(self, path: Path, copied: int) -> int:
        """Copy what has landed since; gives how much there is of the journal now."""
        if self._descriptor is None:
            return copied
        with path.open("rb") as journal:
            journal.seek(copied)
            while data := journal.read(CHUNK):
                if not copied:
                    os.write(self._descriptor, EVENTS_MARK)
                taken = os.write(self._descriptor, data)
                copied += taken
                if taken < len(data):
                    raise BlockingIOError(errno.EAGAIN, "its reader is too slow")
        return copied
