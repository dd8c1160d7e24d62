"""Strongly correlated parameters."""

from __future__ import annotations

import numpy as np
import pytest


def test_pairs_are_those_of_repeated_measurements(repeated, hexaglide):
    """Against the correlation of 40 estimates, good to (1 - rho^2) / sqrt(40)."""
    names = hexaglide.convention.free_names()
    seen = np.corrcoef(np.array([found.free for found in repeated]).T)
    pairs = repeated[0].strongly_correlated()
    assert pairs
    for pair in pairs:
        i, j = names.index(pair.first), names.index(pair.second)
        error = (1.0 - pair.correlation**2) / np.sqrt(len(repeated))
        assert seen[i, j] == pytest.approx(pair.correlation, abs=5.0 * error)


def test_all_pairs_beyond_the_limit_are_named_the_strongest_first(identified):
    everything = identified.strongly_correlated(above=-1.0)
    strengths = [abs(pair.correlation) for pair in everything]
    assert len(everything) == 35 * 34 // 2
    assert strengths == sorted(strengths, reverse=True)
    assert identified.strongly_correlated(above=0.8) == tuple(
        pair for pair in everything if abs(pair.correlation) > 0.8
    )
    assert all(pair.first != pair.second for pair in everything)
