"""How soon the technician's screen shows live readings, answers a key, and is gone, whatever goes on."""

from __future__ import annotations

import asyncio
import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.run_process.client import connect_to_run
from hexacell.run_process.run_socket import socket_path
from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.benchmarks.figures import Figures, at_most
from tests.benchmarks.samples import sample
from tests.waiting import wait_until

NAME = "simulated-hexaglide"
LIVE_S, KEY_S, QUIT_S = 1.5, 0.1, 0.5
RUNS = sample(__name__, "RUNS")
ROUNDS = 8
TABS = {"1": rb">1 Cell", "2": rb">2 Pre", "3": rb">3 Mea", "4": rb">4 Rev", "5": rb">5 His"}
"""What each screen has marked in its second line."""


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Path]:
    for name in (f"{NAME}.toml", f"{NAME}.controller.toml"):
        shutil.copy(bundled_config(NAME).with_name(name), tmp_path)
    path = tmp_path / "served.toml"
    command = [sys.executable, "-m", "hexacell", "simulate", f"{NAME}.toml", "--output", str(path)]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        wait_until(path.exists)
        yield path
        asyncio.run(end_run(path))
        process.send_signal(signal.SIGINT)


async def end_run(path: Path) -> None:
    """End the run that goes on, if one does."""
    if (run := await connect_to_run(socket_path(load_cell(path)))) is not None:
        await run.leave(keep_running=False)


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


@dataclass(frozen=True)
class Speed:
    first_s: float
    live_s: float
    key_s: float
    quit_s: float


def measure(cell: Path) -> Speed:
    """The first screen, live readings, the first visit to each other screen, and quitting."""
    with opened(cell) as screen:
        first = screen.seen_at(rb"Cell")
        live = screen.seen_at(rb"\d\.\d{4}.{0,20}mm")
        visits = [screen.answered_s(key) for key in "23451"]
        return Speed(first - screen.begun, live - screen.begun, max(visits), screen.quit_s("q"))


def test_live_readings_keys_and_quitting(served: Path, figure: Figures) -> None:
    found = [measure(served) for _ in range(RUNS)]
    best = Speed(*(min(getattr(one, name) for one in found) for name in Speed.__dataclass_fields__))
    figure("screen: first drawn", best.first_s, "s")
    figure("screen: live readings", best.live_s, "s", at_most(LIVE_S))
    figure("screen: first visit to a screen, slowest of five", 1e3 * best.key_s, "ms", at_most(1e3 * KEY_S))
    figure("screen: quitting", best.quit_s, "s", at_most(QUIT_S))


def keys_answered(screen: Screen, goes_on: Callable[[], bool] | None = None) -> list[float]:
    """Times of keys, one screen after the other, for some rounds and as long as something goes on."""
    found: list[float] = []
    while len(found) < 5 * ROUNDS or (goes_on is not None and goes_on()):
        found += [screen.answered_s(key) for key in "21435"]
    return found


def judge(figure: Figures, what: str, keys: list[float], quit_s: float) -> None:
    """Say the median and the slowest of some keys; the limit holds for the median, and 95 % of them."""
    usual, slow = median(keys), sorted(keys)[int(0.95 * len(keys))]
    figure(f"screen: a key answered {what}, median", 1e3 * usual, "ms", at_most(1e3 * KEY_S))
    figure(f"screen: 95 % of keys {what} within", 1e3 * slow, "ms", at_most(1e3 * KEY_S))
    figure(f"screen: slowest of the keys {what}", 1e3 * max(keys), f"ms, {len(keys)} keys")
    figure(f"screen: quitting {what}", quit_s, "s", at_most(QUIT_S))


def begin_run(screen: Screen) -> None:
    """Begin a calibration and wait for its first record."""
    screen.seen_at(rb"\d\.\d{4}.{0,20}mm")
    screen.answered_s("2")
    screen.press("s")
    screen.seen_at(rb"1/2 ")


def test_while_a_run_measures(served: Path, figure: Figures) -> None:
    with opened(served) as screen:
        begin_run(screen)
        judge(figure, "while measuring", keys_answered(screen), screen.quit_s("q", "s"))


def test_while_the_run_identifies_and_a_plan_is_tried(served: Path, figure: Figures) -> None:
    """Its long computations: beside measuring, the plan on simulated robots, then the identification."""
    with opened(served) as screen:
        begin_run(screen)
        screen.answered_s("2")
        screen.press("v")
        screen.answered_s("1")
        [run] = (served.parent / "runs" / NAME).glob("2*")

        def computes() -> bool:
            return not any(
                isinstance(event, events.Identified) for event in read_journal(run / "journal.jsonl")
            )

        keys = keys_answered(screen, computes)
        judge(figure, "while a plan is tried, and identifying", keys, screen.quit_s("q", "s"))


def test_with_a_gauge_that_does_not_answer(served: Path, figure: Figures) -> None:
    silent, port = pty.openpty()
    text = served.read_text()
    served.write_text(re.sub(r'port = ".*?"', f'port = "{os.ttyname(port)}"', text, count=1))
    try:
        with opened(served) as screen:
            screen.seen_at(rb"NO READING")
            judge(figure, "with a silent gauge", keys_answered(screen), screen.quit_s("q"))
    finally:
        os.close(silent)
        os.close(port)
