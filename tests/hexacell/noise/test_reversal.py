"""Reversal and repeatability by visits from either side, against joints that lag by what is known."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hexacell.kinematics.parameters import JointUnit
from hexacell.noise.reversal import SIGMAS, Reversal, reversal_of
from hexacell.text.measured_noise import reversal_sentence

BACKLASH = np.array([0.1, 0.06, 0.09, 0.05, 0.08, 0.07])
NOISE_MM = 0.002


def found(count: int, sides: tuple[int, ...], backlash: Any = BACKLASH, seed: int = 1) -> Reversal | None:
    """By pairs of visits, each with joints that came from any of some sides."""
    random, visits = np.random.default_rng(seed), []
    by_joints = random.normal(size=(3, 6))
    for _ in range(count):
        turned = np.subtract(*random.choice(sides, (2, 6))).astype(float)
        shown = -0.5 * by_joints @ (backlash * turned) + np.sqrt(2.0) * NOISE_MM * random.normal(size=3)
        change: Any = SimpleNamespace(
            unexplained_mm=shown,
            joints=np.zeros(6),
            covariance=2.0 * NOISE_MM**2 * np.eye(3),
            by_joints=by_joints,
        )
        visits.append((change, turned))
    return reversal_of(visits, np.zeros(6), np.full(6, 0.1), JointUnit.MM)


@pytest.mark.parametrize("seed", range(5))
def test_visits_from_both_sides_show_what_each_joint_loses_when_it_turns(seed: int) -> None:
    shown = found(40, (-1, 1), seed=seed)
    assert shown is not None
    assert shown.joints is not None
    assert shown.sigma is not None
    assert (np.abs(np.array(shown.joints) - BACKLASH) < 5.0 * np.array(shown.sigma)).all()
    assert max(shown.sigma) < 0.003
    assert shown.repeatability_mm == pytest.approx(shown.ball_mm + SIGMAS * NOISE_MM, rel=0.15)
    assert reversal_sentence(shown).startswith("reversal of the joints 0.0")


def test_from_one_side_only_the_repeatability_is_seen() -> None:
    shown = found(40, (1,))
    assert shown is not None
    assert shown.joints is None
    assert shown.repeatability_mm == pytest.approx(SIGMAS * NOISE_MM, rel=0.3)
    assert "reversal not measured" in reversal_sentence(shown)
    assert found(2, (-1, 1)) is None
