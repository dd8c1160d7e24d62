"""Output of a command, printable: text on stdout, or on stderr where stdout carries a JSON document."""

import json
import os
import sys
from dataclasses import asdict, dataclass, is_dataclass
from datetime import datetime
from pathlib import Path
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
    try:
        # A locale may know no letter beyond ASCII.
        encoding = stream.encoding or "utf-8"
        stream.write(printable(text).encode(encoding, "backslashreplace").decode(encoding))
        stream.flush()
    except BrokenPipeError:
        _discard_rest(stream)
    except OSError as error:
        # A run goes on without its output; the command as a whole is not done.
        _lost.append(error)
        _discard_rest(stream)


def lost_output() -> OSError | None:
    """Why output of this process could not be written, such as a full disk; None if all could be."""
    return _lost[0] if _lost else None


_lost: list[OSError] = []


def _discard_rest(stream: TextIO) -> None:
    """Python flushes the rest of the buffer when it ends, which must not fail again."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
