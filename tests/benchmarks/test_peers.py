"""What ``make bench-peers`` compares, on few robots: who must agree, what chosen poses are worth."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.figures import at_most
from tests.benchmarks.peers.__main__ import compare
from tests.benchmarks.peers.comparison import WHOLE, Comparison, Way
from tests.benchmarks.peers.turns import exponential, left_jacobian
from tests.benchmarks.samples import sample

ROBOTS = sample(__name__, "ROBOTS")
OURS, IPOPT, CERES, PAPER = "hexacell_estimator", "casadi_poses", "ceres_poses", "paper_least_squares"


@pytest.fixture(scope="module")
def compared() -> Comparison:
    pytest.importorskip("casadi", reason="make bench-peers installs it")
    pytest.importorskip("pyceres", reason="make bench-peers installs it")
    return compare(ROBOTS, (OURS, IPOPT, CERES, PAPER))


def errors(compared: Comparison, peer: str, way: Way) -> list[float]:
    results = compared.results[peer]
    return [one.rms_mm for one in results if one.case.way is way and one.case.records == WHOLE]


@pytest.mark.parametrize("way", [Way.CHOSEN, Way.AIMED])
def test_both_libraries_find_the_same_minimum(compared, figure, way: Way) -> None:
    apart = np.abs(np.subtract(errors(compared, IPOPT, way), errors(compared, CERES, way))).max()
    figure(f"IPOPT and Ceres, {way} poses: rms errors differ by", apart, "mm", at_most(1e-6))


def test_ours_is_no_worse_where_records_determine_the_robot(compared, figure) -> None:
    ours, theirs = (np.median(errors(compared, peer, Way.CHOSEN)) for peer in (OURS, IPOPT))
    figure("IPOPT with exact noise model", theirs, "mm")
    figure("ours", ours, "mm", at_most(1.05 * theirs))


def test_chosen_poses_are_worth_more_than_any_estimator(compared, figure) -> None:
    chosen = np.median(errors(compared, OURS, Way.CHOSEN))
    best = min(np.median(errors(compared, peer, Way.RANDOM)) for peer in compared.results)
    figure("the best peer in random poses", best, "mm")
    figure("ours in chosen poses", chosen, "mm", at_most(best / 3.0))


def test_turns_change_as_the_ceres_peer_derives_them() -> None:
    vector, change = np.array([0.3, -0.2, 0.5]), 1e-6 * np.array([1.0, 2.0, -1.0])
    turned = exponential(left_jacobian(vector) @ change) @ exponential(vector)
    np.testing.assert_allclose(exponential(vector + change), turned, atol=1e-11)
