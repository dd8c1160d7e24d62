"""A first resume must do: killed at random instants, runs of the bundled, noisy cell are resumed once.

The program runs as it is installed, in processes of its own. A sample on a small cell without noise
is in ``make test-full`` (``tests/faults/test_killed.py``).
"""

from __future__ import annotations

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from hexacell.cell.bundled import bundled_config
from procedures.journal.journal import read_journal
from tests.benchmarks.figures import NEVER
from tests.benchmarks.samples import sample
from tests.faults.steps import step_of
from tests.faults.test_killed import instants

KILLS = sample(__name__, "KILLS")

AT_ONCE = os.cpu_count() or 1
"""Runs that are killed and resumed beside each other; each needs one core."""

SOONER = 0.97
"""A run that was over at its instant is killed sooner the next time."""


@dataclass(frozen=True)
class Ended:
    """How a process ended, after how long, and what it said last."""

    code: int
    seconds: float
    words: str

    @property
    def passed(self) -> bool:
        return self.code == 0 and self.words.splitlines()[-1].endswith(": pass")


def site(folder: Path, seed: int) -> Path:
    """The bundled cell in a folder of its own, with noise of its own."""
    folder.mkdir()
    bundled = bundled_config("simulated-hexaglide")
    shutil.copy(bundled.with_name("simulated-hexaglide.controller.toml"), folder)
    text = re.sub(r"(?m)(?<=^\[simulation\]\nseed = )\d+", str(seed), bundled.read_text())
    (folder / "cell.toml").write_text(text)
    return folder / "cell.toml"


def hexacell(cell: Path, *arguments: str, dies_after_s: float | None = None) -> Ended:
    """``hexacell run`` to its end, or to the instant at which it is killed."""
    words = [sys.executable, "-m", "hexacell", "run", str(cell), "--unattended", "--mode", "optimise"]
    begun = time.monotonic()
    with subprocess.Popen(
        [*words, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        try:
            said, _ = process.communicate(timeout=dies_after_s)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            said, _ = process.communicate()
    return Ended(process.returncode, time.monotonic() - begun, said)


def is_over(folder: Path) -> bool:
    """Whether the run came to its end; what was killed then is only its process."""
    histories = [read_journal(journal) for journal in folder.glob("runs/*/*/journal.jsonl")]
    return any(history and history[-1].kind == "ended" for history in histories)


@dataclass(frozen=True)
class Resumed:
    """A run that was killed at a share of its duration in a step, and how its first resume ended."""

    share: float
    step: str
    ended: Ended


def killed(folder: Path, seed: int, share: float, duration_s: float) -> Path:
    """A cell whose run was killed at a share of its duration, once it was begun and before it was over."""
    while True:
        shutil.rmtree(folder, ignore_errors=True)
        cell = site(folder, seed)
        ended = hexacell(cell, dies_after_s=share * duration_s)
        if ended.code != -signal.SIGKILL or is_over(folder):
            duration_s = SOONER * min(duration_s, ended.seconds)
        elif any(journal.read_bytes().count(b"\n") for journal in folder.glob("runs/*/*/journal.jsonl")):
            return cell
        else:
            share += 0.02


def resumed(folder: Path, seed: int, share: float, duration_s: float) -> Resumed:
    """A run that is killed and resumed once; its folder is kept if that did not end it with a pass."""
    cell = killed(folder, seed, share, duration_s)
    [journal] = cell.parent.glob("runs/*/*/journal.jsonl")
    step = step_of(read_journal(journal))
    ended = hexacell(cell, "--resume", str(journal.parent))
    if ended.passed:
        shutil.rmtree(folder)
    return Resumed(share, step, ended)


def test_a_first_resume_ends_every_killed_run_with_a_pass(figure, tmp_path) -> None:
    chance = random.Random(9)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        undisturbed = list(
            pool.map(lambda n: hexacell(site(tmp_path / f"undisturbed{n}", n)), range(AT_ONCE))
        )
        assert all(one.passed for one in undisturbed), undisturbed
        duration_s = min(one.seconds for one in undisturbed)
        each = [
            pool.submit(resumed, tmp_path / f"cell{n}", chance.randrange(10**6), share, duration_s)
            for n, share in enumerate(instants(KILLS))
        ]
        done = [one.result() for one in each]
    others = [
        f"{one.share:.3f}, {one.step}: {one.ended.code}, {one.ended.words.splitlines()[-1:]}"
        for one in done
        if not one.ended.passed
    ]
    steps = Counter(one.step for one in done)
    figure("killed runs that the first resume does not end with a pass", len(others), f"of {KILLS}", NEVER)
    figure("killed in", ", ".join(f"{step} {count}" for step, count in steps.most_common(6)))
    confirmed = sum("new records show whether by chance" in one.ended.words for one in done)
    figure("of these with confirming records after a test that failed narrowly", confirmed)
    assert not others, "\n".join(others)
