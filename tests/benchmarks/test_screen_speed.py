"""How soon the technician's screen shows live readings, answers a key, and is gone, whatever goes on."""

import os
import pty
import re
import select
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import pytest

from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.benchmarks.figures import Figures
from tests.benchmarks.machines import at_most_here
from tests.benchmarks.samples import sample
from tests.screen.served_cell import NAME, served_in

FIRST_S, LIVE_S, KEY_S, QUIT_S = 0.3, 1.0, 0.1, 0.5
RUNS = sample(__name__, "RUNS")
ROUNDS = 8
TABS = {
    "1": "▸1 Cell".encode(),
    "2": "▸2 Pre".encode(),
    "3": "▸3 Mea".encode(),
    "4": "▸4 Rev".encode(),
    "5": "▸5 His".encode(),
}
"""What each screen has marked in its second line."""
READING = rb"\d\.\d{4}.{0,20}mm"


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Path]:
    with served_in(tmp_path) as path:
        yield path


@dataclass
class Screen:
    """The program at a terminal of its own."""

    terminal: int
    begun: float

    def press(self, key: str) -> float:
        """Press a key; when that was."""
        pressed = time.perf_counter()
        os.write(self.terminal, key.encode())
        return pressed

    def seen_at(self, pattern: bytes) -> float:
        """When it has shown something."""
        shown = b""
        while not re.search(pattern, shown):
            shown += os.read(self.terminal, 65536)
        return time.perf_counter()

    def answered_s(self, key: str) -> float:
        """How long it takes until another screen is there."""
        pressed = self.press(key)
        return self.seen_at(TABS[key]) - pressed

    def gone_at(self) -> float:
        """When the program has closed the terminal."""
        while True:
            try:
                if select.select([self.terminal], [], [])[0] and not os.read(self.terminal, 65536):
                    return time.perf_counter()
            except OSError:
                return time.perf_counter()

    def quit_s(self, *keys: str) -> float:
        """How long it takes until it is gone after the last of some keys."""
        for key in keys[:-1]:
            self.press(key)
            self.seen_at(rb"A run goes on here")
        pressed = self.press(keys[-1])
        return self.gone_at() - pressed


@contextmanager
def opened(cell: Path) -> Iterator[Screen]:
    """The screen of a cell, and its end."""
    begun = time.perf_counter()
    process, terminal = pty.fork()
    if not process:
        os.environ["TERM"] = "xterm-256color"
        os.execv(sys.executable, [sys.executable, "-m", "hexacell", "tui", str(cell)])
    try:
        yield Screen(terminal, begun)
    finally:
        os.close(terminal)  # which ends it, if nothing has
        os.waitpid(process, 0)


def test_start_first_visits_and_quitting(served: Path, figure: Figures) -> None:
    found = []
    for _ in range(RUNS):
        with opened(served) as screen:
            first = screen.seen_at(rb"Cell") - screen.begun
            live = screen.seen_at(READING) - screen.begun
            found.append((first, live, max(screen.answered_s(key) for key in "23451"), screen.quit_s("q")))
    first, live, key, quitting = map(min, zip(*found, strict=True))
    figure("screen: first drawn", first, "s", at_most_here(FIRST_S))
    figure("screen: live readings", live, "s", at_most_here(LIVE_S))
    figure("screen: first visit to a screen, slowest of five", 1e3 * key, "ms", at_most_here(KEY_S, 1e-3))
    figure("screen: quitting", quitting, "s", at_most_here(QUIT_S))


def identifies(run: Path) -> bool:
    """Whether it measures, or computes what the records give."""
    return not any(isinstance(event, events.Identified) for event in read_journal(run / "journal.jsonl"))


@pytest.mark.parametrize("what", ["measuring", "a plan is tried, and identifying"])
def test_while_a_run_goes_on(served: Path, figure: Figures, what: str) -> None:
    """Its first records; or its long computations: the plan on simulated robots, then the identification.

    The limit holds for the median, and 95 % of the keys.
    """
    with opened(served) as screen:
        screen.seen_at(READING)
        screen.answered_s("2")
        screen.press("s")
        screen.seen_at(rb"1/2 ")
        [run] = (served.parent / "runs" / NAME).glob("2*")
        is_long = what != "measuring"
        if is_long:
            screen.answered_s("2")
            screen.press("v")
            screen.answered_s("1")
        keys: list[float] = []
        while len(keys) < 5 * ROUNDS or (is_long and identifies(run)):
            keys += [screen.answered_s(key) for key in "21435"]
        quitting = screen.quit_s("q", "s")
    usual, slow = median(keys), sorted(keys)[int(0.95 * len(keys))]
    figure(f"screen: a key answered while {what}, median", 1e3 * usual, "ms", at_most_here(KEY_S, 1e-3))
    figure(f"screen: 95 % of keys while {what} within", 1e3 * slow, "ms", at_most_here(KEY_S, 1e-3))
    figure(f"screen: slowest of the keys while {what}", 1e3 * max(keys), f"ms, {len(keys)} keys")
    figure(f"screen: quitting while {what}", quitting, "s", at_most_here(QUIT_S))
