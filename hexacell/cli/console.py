"""Output of a command, printable: text on stdout, or on stderr where stdout carries a JSON document."""

import json
import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import asdict, dataclass, is_dataclass
from datetime import datetime
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, TextIO

from hexacell.printable import printable


@dataclass(frozen=True, slots=True)
class Console:
    """The process's output streams. A reader that has gone away never changes how a command ends."""

    wants_json: bool = False

    def print(self, text: str = "") -> None:
        """One or more lines of text."""
        _write(sys.stderr if self.wants_json else sys.stdout, text + "\n")

    def error(self, text: str) -> None:
        """An error message, on stderr."""
        _write(sys.stderr, text + "\n")

    def warn(self, text: str) -> None:
        """Something that a person should change, on stderr; the command goes on."""
        self.error(f"hexacell: warning: {text}")

    def prompt(self, text: str) -> None:
        """A question, on stderr and without a line feed; the answer is typed on the same line."""
        _write(sys.stderr, text)

    def document(self, document: dict[str, Any]) -> None:
        """The command's one JSON document; nothing without ``--json``."""
        if self.wants_json:
            _write(sys.stdout, json.dumps(document, default=_plain) + "\n")

    def show(self, document: dict[str, Any], text: str) -> None:
        """The result of the command: its document, and the same as text."""
        self.document(document)
        self.print(text)


def _plain(value: Any) -> Any:  # noqa: ANN401 - what a document has
    """What JSON has no word for: a model, a dataclass, a moment, a path."""
    if hasattr(value, "model_dump"):  # of pydantic, which takes long to import
        return value.model_dump(mode="json")
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{value!r} belongs in no document")


def _write(stream: TextIO | None, text: str) -> None:
    if stream is None:  # closed before the program began
        return
    # A locale may know no letter beyond ASCII.
    encoding = stream.encoding or "utf-8"
    with _losses_noted(stream):
        stream.write(printable(text).encode(encoding, "backslashreplace").decode(encoding))
        stream.flush()


@contextmanager
def _losses_noted(stream: TextIO) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        # A run goes on without its output; the command as a whole is not done.
        if not isinstance(error, BrokenPipeError):
            _lost.append(error)
        # Python flushes the rest of the buffer when it ends, which must not fail again.
        with Path(os.devnull).open("wb") as null:
            os.dup2(null.fileno(), stream.fileno())


@dataclass(frozen=True, slots=True)
class _Handed:
    """A stream like another one, that hands what is written to a thread."""

    stream: TextIO
    texts: SimpleQueue[tuple[TextIO, str] | None]

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute of the other
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        self.texts.put((self.stream, text))
        return len(text)

    def flush(self) -> None:
        """The thread writes as soon as the reader takes it."""


@contextmanager
def unhindered_output() -> Iterator[None]:
    """Have a thread write stdout and stderr: a reader that pauses, as after Ctrl-S, holds up no run.

    Only the end of the context waits until all is read.
    """
    texts = SimpleQueue[tuple[TextIO, str] | None]()

    def write_all() -> None:
        for stream, text in iter(texts.get, None):
            with _losses_noted(stream):
                _write_whole(stream, text)

    writer = Thread(target=write_all, name="output", daemon=True)
    writer.start()
    out, err = (one and _Handed(one, texts) for one in (sys.stdout, sys.stderr))
    try:
        with redirect_stdout(out), redirect_stderr(err):
            yield
    finally:
        texts.put(None)
        writer.join()


def _write_whole(stream: TextIO, text: str) -> None:
    """Write past the stream's own buffer, which loses what a pipe that does not block has no room for."""
    try:
        descriptor = stream.fileno()
    except OSError:  # in memory
        stream.write(text)
        return
    data = text.encode(stream.encoding or "utf-8", "backslashreplace")
    while data:
        try:
            data = data[os.write(descriptor, data) :]
        except BlockingIOError:
            select.select((), (descriptor,), ())


def lost_output() -> OSError | None:
    """Why output of this process could not be written, such as a full disk; None if all could be."""
    return _lost[0] if _lost else None


_lost: list[OSError] = []
