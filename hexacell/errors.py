"""The root of all errors, and the exit codes of every command."""

import difflib
from collections.abc import Iterable, Sequence
from enum import IntEnum
from pathlib import Path

from hexacell.printable import printable


class ExitCode(IntEnum):
    """The exit status of the process; stable, see ``docs/interface.md``."""

    DONE = 0
    OUT_OF_LIMITS = 1
    USAGE = 2
    HARDWARE = 3
    ANSWER_NEEDED = 4
    BUSY = 5
    WRITE_BACK_UNDONE = 6
    OUT_OF_TIME = 7
    FAULT = 70
    INTERRUPTED = 130


class HexacellError(Exception):
    """A problem that a person can act on.

    ``subject`` names the device or file, ``line`` counts from 1 inside that file, ``action`` is
    the next thing to do. ``str()`` gives one plain sentence made of them.
    """

    exit_code = ExitCode.USAGE

    def __init__(
        self,
        problem: str,
        *,
        subject: str | Path | None = None,
        line: int | None = None,
        action: str | None = None,
    ) -> None:
        self.problem = problem
        self.subject = None if subject is None else str(subject)
        self.line = line
        self.action = action
        super().__init__(problem)

    def __str__(self) -> str:
        where = "" if self.subject is None else self.subject
        where += "" if self.line is None else f":{self.line}"
        text = f"{where}: {self.problem}" if where else self.problem
        return printable(text if self.action is None else f"{text}. {self.action}")

    @property
    def cause(self) -> str:
        """The sentence without the next thing to do."""
        return str(self).removesuffix(printable(f". {self.action}")) if self.action else str(self)


class UsageError(HexacellError):
    """The command asks for something that cannot be done."""


class FileError(HexacellError):
    """A file is absent, unreadable, or has wrong content."""


class ReachError(HexacellError):
    """A pose that the mechanism cannot reach; the message names the leg."""


class ConvergenceError(HexacellError):
    """A numerical solution was not found."""

    exit_code = ExitCode.OUT_OF_LIMITS


class IdentifiabilityError(HexacellError):
    """The data cannot determine the geometry; the message says what is missing."""

    exit_code = ExitCode.OUT_OF_LIMITS


class LimitError(HexacellError):
    """A result or a measurement lies outside the limits that the cell file states."""

    exit_code = ExitCode.OUT_OF_LIMITS


class DeviceError(HexacellError):
    """A device or its connection failed; ``subject`` is the device's name."""

    exit_code = ExitCode.HARDWARE


class AnswerNeeded(HexacellError):
    """A person must answer or approve, and the run is unattended."""

    exit_code = ExitCode.ANSWER_NEEDED


class CellBusy(HexacellError):
    """Another process holds the cell."""

    exit_code = ExitCode.BUSY


class Interruption(HexacellError):
    """The run was stopped before its end; it can be resumed."""

    exit_code = ExitCode.INTERRUPTED


class OutOfTime(HexacellError):
    """A run without a person is not in its time: it would begin in quiet hours, or lasted too long."""

    exit_code = ExitCode.OUT_OF_TIME


class WriteBackUndone(HexacellError):
    """Writing the controller's config failed; the file is unchanged."""

    exit_code = ExitCode.WRITE_BACK_UNDONE


class SeveralErrors(HexacellError):
    """Several failures at once, in one indented report.

    The exit code is that of the most serious: busy before hardware before usage before the rest.
    """

    def __init__(self, problem: str, errors: list[HexacellError]) -> None:
        self.errors = errors
        super().__init__(problem)
        codes = [error.exit_code for error in errors]
        by_severity = (ExitCode.BUSY, ExitCode.HARDWARE, ExitCode.USAGE)
        self.exit_code = next((code for code in by_severity if code in codes), codes[0])

    def __str__(self) -> str:
        return "\n".join([f"{self.problem}:", *(f"  - {error}" for error in self.errors)])


def joined(problem: str, errors: Sequence[HexacellError]) -> HexacellError:
    """The error to raise for one or more: a single one as it is, several in one report."""
    if len(errors) == 1:
        return errors[0]
    return SeveralErrors(problem, [single for error in errors for single in flatten_errors(error)])


def consists_only_of(error: HexacellError, *kinds: type[HexacellError]) -> bool:
    """Whether an error, or each of several at once, is of these kinds."""
    return all(isinstance(one, kinds) for one in flatten_errors(error))


def flatten_errors(error: HexacellError) -> list[HexacellError]:
    """The single errors in a report."""
    return error.errors if isinstance(error, SeveralErrors) else [error]


def did_you_mean(name: str, known: Iterable[str]) -> str | None:
    """The next action after an unknown name: the known name most like it; None if none is like it."""
    by_lower_case = {candidate.lower(): candidate for candidate in known}
    found = difflib.get_close_matches(name.lower(), by_lower_case, n=1)
    return f"Did you mean '{by_lower_case[found[0]]}'?" if found else None
