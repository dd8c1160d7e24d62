"""Random mutations of everything that the program is given, through the entry points of its commands.

One in two hundred is a process of its own.
"""

import random
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from tests.benchmarks.figures import NEVER, at_most
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.samples import sample
from tests.mutations.attempts import Attempt, Place
from tests.mutations.kinds import drawn_trial
from tests.mutations.prompts import answers_to_prompts
from tests.mutations.sound_cells import few_choices, make_templates
from tests.mutations.trials import Templates

MUTATIONS = sample(__name__, "MUTATIONS")
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


def test_mutated_input_is_refused_or_used(templates, figure) -> None:
    parts = [range(n, min(n + TOGETHER, MUTATIONS)) for n in range(0, MUTATIONS, TOGETHER)]
    found = [one for part in on_all_cores(partial(several, templates), parts) for one in part]
    for one in filter(is_wrong, found):
        print(f"\n  seed {one.seed}, {one.kind}, {one.found.seconds:.1f} s: {one.found}", flush=True)
    for kind, count in Counter(one.kind for one in found).most_common():
        figure(f"mutations tried: {kind}", count)
    codes = Counter(one.found.code for one in found)
    figure("exit codes", ", ".join(f"{code}: {n}" for code, n in sorted(codes.items())))
    wrong = sum(bool(one.found.problems) for one in found)
    figure("with a traceback, a warning or a change outside", wrong, "", NEVER)
    slowest = max(one.found.seconds for one in found)
    figure("longest answer, processor time", slowest, "s", at_most(LONGEST_S))
