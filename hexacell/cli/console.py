"""Words for people: on stdout, or on stderr where stdout carries a JSON document."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Console:
    """Where words go."""

    wants_json: bool = False

    def say(self, words: str = "") -> None:
        """One line, or several, for a person."""
        print(words, file=sys.stderr if self.wants_json else sys.stdout, flush=True)

    def document(self, document: dict[str, Any]) -> None:
        """The one JSON document, where it is wanted."""
        if self.wants_json:
            print(json.dumps(document), flush=True)
