"""A machine that gets worse during a run is named as such; one that scatters alike all the time is not."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hexacell.identification.problem.prior import Noise
from hexacell.noise.worsening import Worsening, worsening_of
from hexacell.text.measured_noise import worsening_sentence

NOISE = Noise(encoder=0.01, gauge_mm=0.01)
VISITS, ENDS = 6, 5


def found(
    random: np.random.Generator, growth: float, *, seen: bool, stops: float = 0.05
) -> Worsening | None:
    """By six visits, and the ends of five points over which stops scatter more and more."""
    changes: list[Any] = []
    for row, times in enumerate([*[1.0] * VISITS, *np.linspace(1.0, growth, ENDS)]):
        by_joints = random.standard_normal((3, 6))
        covariance = 2e-4 * (by_joints @ by_joints.T + np.eye(3))
        unexplained = (
            0.01 * np.sqrt(2.0) * (by_joints @ random.standard_normal(6) + random.standard_normal(3))
        )
        stopped = np.sqrt(2.0) * stops * times * random.standard_normal(6)
        changes.append(
            SimpleNamespace(
                unexplained_mm=unexplained if seen else unexplained + by_joints @ stopped,
                joints=np.sqrt(2.0) * 0.01 * random.standard_normal(6) + stopped * seen,
                covariance=covariance,
                by_joints=by_joints,
                readings=10 * (row >= VISITS),
                by_drift=np.zeros((3, 3)),
            )
        )
    return worsening_of(changes, ENDS, NOISE)


@pytest.mark.parametrize("seen", [True, False])
def test_scatter_that_grows_during_a_run_is_named_with_both_sizes(seen: bool) -> None:
    random = np.random.default_rng(1)
    named = [one for _ in range(100) if (one := found(random, 10.0, seen=seen)) is not None]
    assert len(named) > 75
    assert np.mean([one.is_seen == seen for one in named]) > 0.9
    assert np.median([one.later_mm / one.first_mm for one in named]) > 3.0
    assert "the machine got worse" in worsening_sentence(named[0])


@pytest.mark.parametrize(("seen", "stops"), [(True, 0.05), (False, 0.05), (False, 0.0)])
def test_a_machine_of_constant_scatter_is_not_named(seen: bool, stops: float) -> None:
    random = np.random.default_rng(2)
    assert sum(found(random, 1.0, seen=seen, stops=stops) is not None for _ in range(400)) <= 4
