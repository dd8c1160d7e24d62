"""Mutated answers, typed at a terminal whenever something is asked."""

import contextlib
import json
import os
import pty
import random
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from hexacell.cli.console import Console
from tests.cli.cell_folder import ASK, BY_HAND, changed
from tests.mutations.attempts import Attempt, Place, attempt
from tests.mutations.journals import with_checksum
from tests.mutations.texts import ANY, STRANGE_BYTES, STRANGE_NUMBERS, STRANGE_TEXTS, mutated
from tests.mutations.trials import CELL, OF_A_RUN, RUN, Templates

OFFERED = ("", "y", "yes", "no", "n", "a", "r", "u", "m", "retry", "abort", "simulated-hexaglide")
END_OF_INPUT = b"\x04"
MOST_ANSWERS = 8


def answer(draw: random.Random) -> bytes:
    """A line that is, or nearly is, or is far from an answer."""
    line = draw.choice((*OFFERED, *STRANGE_TEXTS, *STRANGE_NUMBERS)).encode("utf-8", "replace")[:1000]
    if draw.random() < 0.5:
        line = draw.choice(
            (line.upper(), line + b" ", b" " + line, line * 2, line + draw.choice(STRANGE_BYTES))
        )
    if draw.random() < 0.3:
        line = mutated(line, ANY, draw)[:1000]
    line = line.replace(b"\n", b" ").replace(b"\r", b" ")
    # A pause is a person's to end, and asks nothing.
    is_pause = line.decode("utf-8", "replace").strip() in {"p", "P"}
    return (b"no pause" if is_pause else line) + b"\n"


@contextlib.contextmanager
def typed_at_a_terminal(answers: Sequence[bytes]) -> Iterator[None]:
    """Type the next answer whenever something is asked; after the last one the input ends."""
    master, slave = pty.openpty()
    left = [*answers, END_OF_INPUT]
    prompt = Console.prompt

    def prompt_and_type(console: Console, text: str) -> None:
        prompt(console, text)
        os.write(master, left.pop(0) if left else END_OF_INPUT)

    with os.fdopen(slave, encoding="utf-8") as terminal, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", terminal)
        patch.setattr(Console, "prompt", prompt_and_type)
        patch.setattr("hexacell.cli.commands.run.is_interactive", lambda: True)
        yield
    os.close(master)


def ask_before_writing(folder: Path) -> None:
    """Let a run that is resumed ask a person for approval, and for placing the gauges."""
    cell, journal = folder / CELL, folder / RUN / "journal.jsonl"
    first, *others = journal.read_bytes().splitlines(keepends=True)
    record = json.loads(first)
    text = changed(cell.read_text(), (ASK, BY_HAND))
    cell.write_text(text)
    record["event"]["cell_text"] = text
    del record["crc"]
    journal.write_bytes(with_checksum(record) + b"".join(others))


def answers_to_prompts(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A run at which a person types all kinds of things."""
    place.refill(templates.interrupted[1], templates.small)
    ask_before_writing(place.cell)
    lines = [answer(draw) for _ in range(draw.randint(1, MOST_ANSWERS))]
    with typed_at_a_terminal(lines):
        return attempt(["run", place.cell / CELL, "--mode", "optimise", "--resume", "run"], place, OF_A_RUN)
