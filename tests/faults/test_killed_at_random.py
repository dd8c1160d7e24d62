"""SIGKILL at random instants, wherever the program is: in a computation, a write, a question."""

from __future__ import annotations

import random
from typing import Any

import pytest

from tests.faults.killing import KILLED, finish, history_of
from tests.faults.matrix import step_of
from tests.faults.promises import require_identical

INSTANTS = 200
SAMPLE = 2


@pytest.mark.parametrize(
    "number", [SAMPLE, pytest.param(INSTANTS, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])]
)
def test_at_any_instant(number: int, program: Any, new_site: Any, undisturbed: Any, case: Any) -> None:
    for seconds in instants(number, undisturbed.seconds):
        site = new_site()
        ended = program.run(site, die_after_s=seconds)
        assert ended.code in {KILLED, 0}, ended.words
        step = step_of(history_of(site))
        case("killed at a random instant", step, finish(program, site))
        require_identical(site, undisturbed.site)


def instants(number: int, duration_s: float) -> list[float]:
    """Evenly over the time that a run takes here and now, each moved at random."""
    chance = random.Random(number)
    return [duration_s * (place + chance.random()) / number for place in range(number)]
