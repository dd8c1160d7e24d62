"""SIGKILL at random instants: in a computation, a write or a question."""

from __future__ import annotations

import random
from typing import Any

import pytest

from tests.faults.killing import KILLED, finish
from tests.faults.promises import require_identical

INSTANTS = 200

SOONER = 0.95


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_run_killed_at_a_random_instant_is_resumed(program: Any, new_site: Any, undisturbed: Any) -> None:
    duration_s = undisturbed.ended.seconds
    for share in instants(INSTANTS):
        site, duration_s = killed(program, new_site, share, duration_s)
        finish(program, site)
        require_identical(site, undisturbed.site)


def instants(number: int) -> list[float]:
    """Evenly over the time that a run takes, as shares of it, each moved at random."""
    chance = random.Random(number)
    return [(place + chance.random()) / number for place in range(number)]


def killed(program: Any, new_site: Any, share: float, duration_s: float) -> tuple[Any, float]:
    """A run killed at an instant of it; and how long a run takes, less if it was over already then."""
    while True:
        site = new_site()
        ended = program.run(site, die_after_s=share * duration_s)
        if ended.code == KILLED:
            return site, duration_s
        assert ended.code == 0, ended.words
        duration_s = SOONER * min(duration_s, ended.seconds)
