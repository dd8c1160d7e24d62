"""Words for people: on stdout, or on stderr where stdout carries a JSON document."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass
from typing import Any, TextIO


@dataclass(frozen=True, slots=True)
class Console:
    """Where words go. Whether anybody still reads them never decides how a command ends."""

    wants_json: bool = False

    def say(self, words: str = "") -> None:
        """One line, or several, for a person."""
        _write(sys.stderr if self.wants_json else sys.stdout, words + "\n")

    def error(self, words: str) -> None:
        """What went wrong, on stderr."""
        _write(sys.stderr, words + "\n")

    def ask(self, question: str) -> None:
        """A question, on stderr; the answer is typed on the same line."""
        _write(sys.stderr, question)

    def document(self, document: dict[str, Any]) -> None:
        """The one JSON document, where it is wanted."""
        if self.wants_json:
            _write(sys.stdout, json.dumps(document) + "\n")


def _write(stream: TextIO | None, text: str) -> None:
    if stream is None:  # closed before the program began
        return
    try:
        stream.write(text)
        stream.flush()
    except BrokenPipeError:
        # The reader has gone. What is still buffered must go somewhere when Python ends.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
