"""What a run folder keeps of a run that could not begin: when it was tried, and why it was refused."""

from __future__ import annotations

from datetime import datetime

from pydantic import ValidationError

from hexacell.cell.fields import Frozen, first_mistake
from hexacell.errors import FileError
from hexacell.runs.run_folder import RunFolder
from hexacell.storage.atomic_files import create_folder_durably, read_text, write_atomically


class StartAttempt(Frozen):
    """One try to begin a run, when it was refused (UTC), why, and the exit code of the reason."""

    at: datetime
    reason: str
    exit_code: int


class StartAttempts(Frozen):
    """All tries of one night, oldest first; a journal beside them says that the run began after them.

    ``mode`` is what the run was for.
    """

    mode: str
    attempts: tuple[StartAttempt, ...]

    @property
    def last(self) -> StartAttempt:
        """The latest try."""
        return self.attempts[-1]

    @property
    def line(self) -> str:
        """Why the run did not begin, in one line."""
        tries = len(self.attempts)
        often = "" if tries == 1 else f" ({tries} tries)"
        return f"not begun{often}: {' '.join(self.last.reason.split())}"


def read_attempts(folder: RunFolder) -> StartAttempts | None:
    """The tries that a run folder keeps; none where the run began at once.

    Raises:
        FileError: they cannot be read.
    """
    path = folder.attempts
    if not path.is_file():
        return None
    try:
        return StartAttempts.model_validate_json(read_text(path))
    except ValidationError as error:
        raise FileError(
            first_mistake(error, "the note"), subject=path, action="Delete it; it is a note only"
        ) from error


def note_attempt(folder: RunFolder, mode: str, attempt: StartAttempt) -> StartAttempts:
    """Add a try to those that a run folder keeps; the folder is made.

    Raises:
        FileError: it cannot be written.
    """
    before = read_attempts(folder)
    attempts = StartAttempts(mode=mode, attempts=(*(before.attempts if before else ()), attempt))
    create_folder_durably(folder.path)
    write_atomically(folder.attempts, f"{attempts.model_dump_json(indent=1)}\n".encode())
    return attempts
