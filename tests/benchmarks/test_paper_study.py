"""``hexacell study paper`` at its full size: the paper's figures in shape, and ours better at every point.

``DRAWS`` in the environment says how many draws of each case.
"""

from __future__ import annotations

import os
from functools import cache
from math import isfinite, isnan
from pathlib import Path

import pytest

from hexacell.study.paper_simulation import PAPER, PAPER_EXACT_MM, PAPER_NOISY_MM, PaperStudy
from hexacell.study.tasks import processes, run_study

pytestmark = pytest.mark.benchmark

DRAWS = int(os.environ.get("DRAWS", "20"))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> PaperStudy:
    return _study(tmp_path_factory.mktemp("study"))


@cache
def _study(folder: Path) -> PaperStudy:
    return run_study(PAPER, folder, DRAWS, processes(None), lambda *_: None)


def test_one_point_never_identifies(study, say) -> None:
    [(four, five)] = [(study.figures[4][0], study.figures[5][0])]
    say("one point: ours refuses", f"{four.noisy.refused}, {five.noisy.refused} of {DRAWS}", "all")
    assert four.noisy.refused == five.noisy.refused == DRAWS
    assert not min(four.exact.paper_mm, five.exact.paper_mm) < 1.0


def test_two_points_without_noise_do(study, say) -> None:
    for one in study.figures[4][1:]:
        worst = max(one.exact.ours_mm, one.exact.paper_mm if one.exact.settled else 0.0)
        say(f"figure 4, {one.points} points, no noise", f"{worst:.0e} mm", f"{PAPER_EXACT_MM:g}")
        assert worst <= PAPER_EXACT_MM


def test_five_orientations_at_two_or_three_points_do_not(study, say) -> None:
    for one in study.figures[5][1:3]:
        errors = (one.exact.paper_mm, one.exact.ours_mm)
        told = ", ".join(f"{error:.2f}" for error in errors)
        say(f"figure 5, {one.points} points, no noise: paper's, ours", f"{told} mm", "no")
        assert all(isnan(error) or error > 1.0 for error in errors)


def test_errors_fall_with_the_number_of_points(study, say) -> None:
    for figure, sets in study.figures.items():
        falling = [one.noisy.ours_mm for one in sets if isfinite(one.noisy.ours_mm)]
        say(f"figure {figure}, ours with noise", ", ".join(f"{one:.2f}" for one in falling), "falling")
        assert falling == sorted(falling, reverse=True)


def test_ours_is_better_at_every_point_of_both_figures(study, say) -> None:
    for figure, sets in study.figures.items():
        for one in sets:
            if one.noisy.settled and one.noisy.refused < DRAWS:
                both = one.noisy.ours_there_mm, one.noisy.paper_mm
                told = ", ".join(f"{error:.2f}" for error in both)
                say(f"figure {figure}, {one.points} points: ours, paper's", f"{told} mm", "less")
                assert both[0] < both[1]


def test_the_papers_estimator_comes_within_a_factor_of_two_of_its_figure(study, say) -> None:
    """With the best of the sets of orientations that are swept, by the median of the draws that end."""
    best = min(study.sweep, key=lambda one: one.noisy.paper_mm)
    words = f"{best.noisy.paper_mm:.2f} mm: {best.angles}, {best.amplitude_deg:g} deg"
    say("five points, eleven orientations, paper's estimator", words, f"{PAPER_NOISY_MM:g}, times 2")
    assert PAPER_NOISY_MM / 2.0 <= best.noisy.paper_mm <= 2.0 * PAPER_NOISY_MM
