"""Files that a command writes because an option names them: one place opens all of them.

What a person types may be the name of a cell, a config or a journal. An option therefore replaces only a
file that an earlier call of it wrote, which the file's own text shows, or an empty one. Beside a journal
nothing is written but a report, and that through no link: the folder may come from elsewhere.
"""

import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path

from hexacell.errors import FileError
from hexacell.storage.atomic_files import NOT_FOR_OTHERS, os_errors, write_atomically

RUN_JOURNAL = "journal.jsonl"
_SEARCHED_BYTES = 1 << 16


@dataclass(frozen=True, slots=True)
class OutputKind:
    """What an option writes, and whether it may be put into a run folder.

    ``mark`` is in the first or the last bytes of each such file; None where the file must be new. ``mode``
    has the permissions of a new file that is written bit by bit.
    """

    noun: str
    mark: re.Pattern[bytes] | None
    mode: int = 0o666 & ~NOT_FOR_OTHERS
    may_be_in_run: bool = False


EVENTS_MARK = b" "
"""Before what is a copy of a journal, line by line; it tells the two apart, and JSON may begin so."""
EVENTS = OutputKind(
    "events of a run", re.compile(rb"\A" + EVENTS_MARK + rb'\{"n":1,"version":\d+,"at":"'), mode=0o600
)
LOG = OutputKind("a log of hexacell", re.compile(rb"\A\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z [A-Z]+ [a-z]"))
METRICS = OutputKind("metrics of cells", re.compile(rb"\A# HELP hexacell_"))
REPORT = OutputKind(
    "a report of a run",
    re.compile(
        rb'<meta name="generator" content="hexacell">|\A%PDF-[\s\S]*hexacell'
        rb"|\A<\?xml [\s\S]*<dcc:dccSoftware>[\s\S]{0,200}>hexacell<"
    ),
    may_be_in_run=True,
)
PICTURE_MARK = b"<!-- made by hexacell study, which replaces this file -->\n"
PICTURE = OutputKind("a picture of a study", re.compile(re.escape(PICTURE_MARK) + rb"\Z"))
VIEW_MARK = b"<!-- made by hexacell view, which replaces this file -->\n"
VIEW = OutputKind("a view of a robot", re.compile(re.escape(VIEW_MARK) + rb"\Z"), may_be_in_run=True)
SERVED_MARK = b"# made by hexacell simulate, which replaces this file\n"
SERVED_CELL = OutputKind("a cell file of `simulate`", re.compile(rb"\A" + re.escape(SERVED_MARK)))
UNIT = OutputKind("a unit of systemd", re.compile(rb"\A# Written by `hexacell schedule` for "))
NEW_CELL = OutputKind("a new cell file", None)
NEW_ANSWERS = OutputKind("new answers", None)


@dataclass(frozen=True, slots=True)
class OutputFile:
    """A file that an option names, and what the option writes."""

    path: Path
    kind: OutputKind

    def require(self) -> None:
        """Refuse a file that this option did not write, a link to nothing, and the folder of a run.

        Raises:
            FileError: it is one of these, or cannot be read.
        """
        with os_errors("cannot be written", self.path):
            target, is_link = Path(os.path.realpath(self.path)), self.path.is_symlink()
            if not self.kind.may_be_in_run and os.path.lexists(target.parent / RUN_JOURNAL):
                raise self._refusal("is in the folder of a run, which keeps only what the run wrote")
            if is_link and os.path.lexists(self.path.parent / RUN_JOURNAL):
                raise self._refusal("is a link in the folder of a run")
            try:
                status = target.stat()
            except (FileNotFoundError, NotADirectoryError):
                if is_link:
                    raise self._refusal("is a link to nothing") from None
                return
            if stat.S_ISREG(status.st_mode):
                with target.open("rb") as stream:
                    first = stream.read(_SEARCHED_BYTES)
                    stream.seek(max(0, status.st_size - _SEARCHED_BYTES))
                    self._require_ours(first + stream.read(_SEARCHED_BYTES))

    def write(self, data: bytes, *, for_everybody: bool = False) -> None:
        """Write a whole file in one step; raises ``FileError`` as :meth:`require` and if it cannot be."""
        self.require()
        write_atomically(self.path, data, for_everybody=for_everybody)

    def open_stream(self, *, appends: bool = False, waits: bool = True) -> int:
        """A descriptor for what is written bit by bit; the file is emptied first, unless one ``appends``.

        With ``waits`` a pipe waits for its reader. Raises ``OSError``, or ``FileError`` as :meth:`require`.
        """
        self.require()
        flags = (os.O_APPEND if appends else 0) | (0 if waits else os.O_NONBLOCK)
        flags |= os.O_WRONLY | os.O_CLOEXEC
        try:
            return os.open(self.path, flags | os.O_CREAT | os.O_EXCL, self.kind.mode)
        except FileExistsError:
            descriptor = os.open(self.path, flags)
        status = os.fstat(descriptor)
        if not appends and stat.S_ISREG(status.st_mode):
            if status.st_nlink > 1:  # the other may be that of a journal, which events are a copy of
                os.close(descriptor)
                raise self._refusal("has another name too, whose content would be lost")
            os.ftruncate(descriptor, 0)
        return descriptor

    def _require_ours(self, data: bytes) -> None:
        if (mark := self.kind.mark) is None:
            raise self._refusal("is there already")
        # An empty file is nobody's, but for locks.
        if (data or ".hexacell-" in self.path.name) and mark.search(data) is None:
            raise self._refusal(f"holds something else than {self.kind.noun}, and is left as it is")

    def _refusal(self, problem: str) -> FileError:
        return FileError(problem, subject=self.path, action="Name a new file")
