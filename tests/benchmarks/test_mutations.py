"""Random mutations of everything that the program is given, through the entry points of its commands.

``MUTATIONS`` in the environment says how many; the target is for 10,000. All cores are used. One in
two hundred is a process of its own.
"""

from __future__ import annotations

import os
import random
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import pytest

from tests.mutations.attempts import Attempt, Place
from tests.mutations.kinds import drawn_trial
from tests.mutations.prompts import answers_to_prompts
from tests.mutations.sound_cells import few_choices, make_templates
from tests.mutations.trials import Templates

pytestmark = pytest.mark.benchmark

MUTATIONS = int(os.environ.get("MUTATIONS", "100"))
TOGETHER = 20
"""Trials that a worker makes in a row."""

PROCESS_EVERY = 200
LONGEST_S = 10.0
"""Of the processor's time for an answer."""


@dataclass(frozen=True)
class Tried:
    """A trial by its seed, and how it ended."""

    seed: int
    kind: str
    found: Attempt


@pytest.fixture(scope="module")
def templates(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Templates]:
    with few_choices():
        yield make_templates(tmp_path_factory.mktemp("templates"))


def is_wrong(one: Tried) -> bool:
    """Whether a trial ended as none may."""
    return bool(one.found.problems) or one.found.seconds > LONGEST_S


def tried(templates: Templates, seed: int, folder: Path) -> Tried:
    """One trial; a terminal of this process serves no other one."""
    draw = random.Random(seed)
    trial = drawn_trial(draw)
    is_process = seed % PROCESS_EVERY == 0 and trial is not answers_to_prompts
    found = trial(templates, Place(folder / "place", is_process), draw)
    return Tried(seed, trial.__name__, found)


def several(templates: Templates, seeds: range) -> list[Tried]:
    """Some trials, in a worker."""
    with tempfile.TemporaryDirectory() as folder:
        return [tried(templates, seed, Path(folder)) for seed in seeds]


def test_mutated_input_is_refused_or_used(templates, say) -> None:
    parts = [range(n, min(n + TOGETHER, MUTATIONS)) for n in range(0, MUTATIONS, TOGETHER)]
    with ProcessPoolExecutor(mp_context=get_context("fork")) as pool:
        found: list[Tried] = []
        for part in pool.map(several, [templates] * len(parts), parts):
            found += part
            for one in filter(is_wrong, part):
                print(
                    f"\n  seed {one.seed}, {one.kind}, {one.found.seconds:.1f} s: {one.found}", flush=True
                )
            if len(found) % 200 == 0:
                print(f"\n  {len(found)} of {MUTATIONS}", end="", flush=True)
    codes = Counter(one.found.code for one in found)
    kinds = Counter(one.kind for one in found)
    slow = [one for one in found if one.found.seconds > LONGEST_S]
    slowest = max(found, key=lambda one: one.found.seconds)
    wrong = [one for one in found if one.found.problems]
    say("mutations tried", str(len(found)), ", ".join(f"{n} {kind}" for kind, n in kinds.most_common()))
    say("exit codes", ", ".join(f"{code}: {n}" for code, n in sorted(codes.items())), "never 70")
    say("with a traceback, a warning or a change outside", str(len(wrong)), "none")
    say("longest answer, s of processor time", f"{slowest.found.seconds:.1f}", f"{LONGEST_S:g}")
    say("answers that took longer", str(len(slow)), "none")
    assert not wrong
    assert not slow
