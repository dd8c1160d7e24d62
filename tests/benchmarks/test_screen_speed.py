"""How soon the technician's screen shows live readings, answers a key, and is gone."""

from __future__ import annotations

import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from hexacell.cell.bundled import bundled_config
from tests.benchmarks.conftest import Say
from tests.waiting import wait_until

pytestmark = pytest.mark.benchmark

NAME = "simulated-hexaglide"
LIVE_S, KEY_S, QUIT_S = 1.5, 0.1, 0.5
RUNS = 5


@dataclass(frozen=True)
class Speed:
    first_s: float
    live_s: float
    key_s: float
    quit_s: float


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Path]:
    for name in (f"{NAME}.toml", f"{NAME}.controller.toml"):
        shutil.copy(bundled_config(NAME).with_name(name), tmp_path)
    path = tmp_path / "served.toml"
    command = [sys.executable, "-m", "hexacell", "simulate", f"{NAME}.toml", "--output", str(path)]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        wait_until(path.exists)
        yield path
        process.send_signal(signal.SIGINT)


def seen_at(terminal: int, pattern: bytes) -> float:
    """When the terminal has shown something."""
    shown = b""
    while not re.search(pattern, shown):
        shown += os.read(terminal, 65536)
    return time.perf_counter()


def gone_at(terminal: int) -> float:
    """When the program has closed the terminal."""
    while True:
        try:
            if select.select([terminal], [], [])[0] and not os.read(terminal, 65536):
                return time.perf_counter()
        except OSError:
            return time.perf_counter()


def measure(cell: Path) -> Speed:
    begun = time.perf_counter()
    process, terminal = pty.fork()
    if not process:
        os.environ["TERM"] = "xterm-256color"
        os.execv(sys.executable, [sys.executable, "-m", "hexacell", "tui", str(cell)])
    first = seen_at(terminal, rb"Cell")
    live = seen_at(terminal, rb"\d\.\d{4}.{0,20}mm")
    for key, text in ((b"3", rb"no run is being"), (b"1", rb"as they show")):  # made, then shown again
        pressed = time.perf_counter()
        os.write(terminal, key)
        answered = seen_at(terminal, text)
    quitting = time.perf_counter()
    os.write(terminal, b"q")
    gone = gone_at(terminal)
    os.waitpid(process, 0)
    os.close(terminal)
    return Speed(first - begun, live - begun, answered - pressed, gone - quitting)


def test_live_readings_keys_and_quitting(served: Path, say: Say) -> None:
    found = [measure(served) for _ in range(RUNS)]
    best = Speed(*(min(getattr(one, name) for one in found) for name in Speed.__dataclass_fields__))
    say("screen: first drawn", f"{best.first_s:.2f} s", "at once")
    say("screen: live readings", f"{best.live_s:.2f} s", f"{LIVE_S:g} s")
    say("screen: a key answered", f"{1e3 * best.key_s:.0f} ms", f"{1e3 * KEY_S:.0f} ms")
    say("screen: quitting", f"{best.quit_s:.2f} s", f"{QUIT_S:g} s")
    assert best.live_s < LIVE_S
    assert best.key_s < KEY_S
    assert best.quit_s < QUIT_S
