"""Repeated readings correct the noise that is stated only where they contradict it."""

from __future__ import annotations

import numpy as np
import pytest

from hexacell.identification.problem.prior import Noise
from hexacell.noise.allowances import ReferenceChange
from hexacell.noise.approach_scatter import RepeatedApproaches
from hexacell.noise.repeats import Repeats

NOISE = Noise(encoder=0.01, gauge_mm=0.01)


def repeats(ratio: float, random) -> Repeats:
    """Six visits more than the first and eight returns, of a machine this much noisier than stated."""
    visits = float(np.mean((ratio * random.standard_normal(18)) ** 2)) ** 0.5
    approaches = RepeatedApproaches(
        visits=7, degrees_of_freedom=18, ball_mm=0.1, ratio=visits, ratio_as_drawn=visits
    )
    changes = [
        ReferenceChange(ratio * random.standard_normal(3), np.eye(3), np.zeros(3), np.zeros(6), 0.0)
        for _ in range(8)
    ]
    return Repeats.of(approaches, changes)


def test_noise_as_stated_stays_as_it_is() -> None:
    random = np.random.default_rng(1)
    found = [repeats(1.0, random).applied_to(NOISE) for _ in range(500)]
    assert np.mean([one == NOISE for one in found]) == pytest.approx(0.99, abs=0.01)


@pytest.mark.parametrize("ratio", [2.0, 5.0])
def test_larger_noise_is_found_with_its_size_and_freedom(ratio) -> None:
    random = np.random.default_rng(2)
    found = [repeats(ratio, random).applied_to(NOISE) for _ in range(300)]
    assert np.mean([one.encoder for one in found]) == pytest.approx(0.01 * ratio, rel=0.05)
    assert np.mean([one.freedom == 18 + 8 * 3 for one in found]) > 0.98


def test_what_the_noise_has_no_room_for_counts_as_stops_at_work() -> None:
    random = np.random.default_rng(3)
    sizes = [repeats(3.0, random).unseen_stops(NOISE) for _ in range(300)]
    assert np.mean(sizes) == pytest.approx(0.01 * np.sqrt(8.0), rel=0.05)
    assert repeats(0.5, random).unseen_stops(NOISE) == 0.0
