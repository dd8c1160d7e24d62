"""A first resume must do: killed at random instants, runs of the bundled, noisy cell are resumed once.

The program runs as it is installed, in processes of its own. A sample on a small cell without noise
is in ``make test-full`` (``tests/faults/test_killed.py``).
"""

import os
import random
import re
import shutil
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
from tests.faults.cell import Site
from tests.faults.promises import history_of
from tests.faults.steps import step_of
from tests.faults.test_killed import instants

KILLS = sample(__name__, "KILLS")

AT_ONCE = os.cpu_count() or 1
"""Runs that are killed and resumed beside each other; each needs one core."""

SOONER = 0.97
"""A run that was over at its instant is killed sooner the next time."""


@dataclass(frozen=True)
class Ended:
    """A process that ended by itself, after how long, and what it said."""

    seconds: float
    words: str

    @property
    def passed(self) -> bool:
        return self.words.rstrip().endswith(": pass")


def new_site(folder: Path, seed: int) -> Site:
    """The bundled cell in a folder of its own, with noise of its own."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    bundled = bundled_config("simulated-hexaglide")
    shutil.copy(bundled.with_name("simulated-hexaglide.controller.toml"), folder)
    text = re.sub(r"(?m)(?<=^\[simulation\]\nseed = )\d+", str(seed), bundled.read_text())
    (folder / "cell.toml").write_text(text)
    return Site(folder)


def hexacell(site: Site, *arguments: str, dies_after_s: float | None = None) -> Ended | None:
    """``hexacell run`` to its end; None if it was killed before."""
    words = [sys.executable, "-m", "hexacell", "run", str(site.cell_path), "--unattended", *arguments]
    begun = time.monotonic()
    try:
        ended = subprocess.run(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=dies_after_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None
    return Ended(time.monotonic() - begun, ended.stdout)


def killed(folder: Path, seed: int, share: float, duration_s: float) -> Site:
    """A cell whose run was killed at a share of its duration, once it was begun and before it was over."""
    while True:
        site = new_site(folder, seed)
        ended = hexacell(site, "--mode", "optimise", dies_after_s=share * duration_s)
        history = history_of(site)
        if ended is not None or (history and history[-1].kind == "ended"):
            duration_s = SOONER * min(duration_s, duration_s if ended is None else ended.seconds)
        elif history:
            return site
        else:
            share += 0.02


@dataclass(frozen=True)
class Resumed:
    """A run that was killed at a share of its duration in a step, and how its first resume ended."""

    share: float
    step: str
    ended: Ended


def resumed(folder: Path, seed: int, share: float, duration_s: float) -> Resumed:
    """A run that is killed and resumed once."""
    site = killed(folder, seed, share, duration_s)
    step = step_of(read_journal(site.run().journal))
    ended = hexacell(site, "--mode", "optimise", "--resume", str(site.run().path))
    assert ended is not None
    shutil.rmtree(folder)
    print(f"\n{share:.3f}, {step}: {ended.words.splitlines()[-1:]}", flush=True)
    return Resumed(share, step, ended)


def test_a_first_resume_ends_every_killed_run_with_a_pass(figure, tmp_path) -> None:
    chance = random.Random(9)
    undisturbed = hexacell(new_site(tmp_path / "undisturbed", 0), "--mode", "optimise")
    assert undisturbed is not None
    assert undisturbed.passed, undisturbed.words
    with ThreadPoolExecutor(AT_ONCE) as pool:
        each = [
            pool.submit(resumed, tmp_path / f"cell{n}", chance.randrange(10**6), share, undisturbed.seconds)
            for n, share in enumerate(instants(KILLS))
        ]
        done = [one.result() for one in each]
    others = [one for one in done if not one.ended.passed]
    steps = Counter(one.step for one in done)
    figure("killed runs that the first resume does not end with a pass", len(others), f"of {KILLS}", NEVER)
    figure("killed in", ", ".join(f"{step} {count}" for step, count in steps.most_common(6)))
    confirmed = sum("new records show whether by chance" in one.ended.words for one in done)
    figure("of these with confirming records after a test that failed narrowly", confirmed)
