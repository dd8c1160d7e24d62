"""``hexacell study paper`` at its full size: the paper's figures in shape, and ours better."""

from __future__ import annotations

from functools import cache
from itertools import count, pairwise
from math import isfinite, isnan
from pathlib import Path

import pytest

from hexacell.study.paper_simulation import PAPER, PAPER_EXACT_MM, PAPER_NOISY_MM, PaperStudy
from hexacell.study.tasks import processes, run_study
from tests.benchmarks.figures import at_least, at_most, between
from tests.benchmarks.samples import sample

DRAWS = sample(__name__, "DRAWS")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> PaperStudy:
    return _study(tmp_path_factory.mktemp("study"))


@cache
def _study(folder: Path) -> PaperStudy:
    return run_study(PAPER, folder, DRAWS, processes(None), lambda *_: None)


def test_one_point_never_identifies(study, figure) -> None:
    for name in (4, 5):
        one = study.figures[name][0]
        figure(f"figure {name}, one point: ours refuses", one.noisy.refused, f"of {DRAWS}", at_least(DRAWS))
        assert not one.exact.paper_mm < 1.0


def test_two_points_without_noise_do(study, figure) -> None:
    for one in study.figures[4][1:]:
        worst = max(one.exact.ours_mm, one.exact.paper_mm if one.exact.settled else 0.0)
        figure(f"figure 4, {one.points} points, no noise", worst, "mm", at_most(PAPER_EXACT_MM))


def test_five_orientations_at_two_or_three_points_do_not(study, figure) -> None:
    for one in study.figures[5][1:3]:
        for who, error in (("paper's", one.exact.paper_mm), ("ours", one.exact.ours_mm)):
            target = None if isnan(error) else at_least(1.0)
            figure(f"figure 5, {one.points} points, no noise: {who}", error, "mm", target)


def test_errors_fall_with_the_number_of_points(study, figure) -> None:
    for name, sets in study.figures.items():
        falling = [one.noisy.ours_mm for one in sets if isfinite(one.noisy.ours_mm)]
        for (before, after), points in zip(pairwise(falling), count(2), strict=False):
            figure(f"figure {name}, ours with noise, step {points - 1}", after, "mm", at_most(before))


def test_ours_is_better_at_every_point_of_both_figures(study, figure) -> None:
    for name, sets in study.figures.items():
        for one in sets:
            if one.noisy.settled and one.noisy.refused < DRAWS:
                paper = one.noisy.paper_mm
                figure(f"figure {name}, {one.points} points: paper's", paper, "mm")
                figure(
                    f"figure {name}, {one.points} points: ours",
                    one.noisy.ours_there_mm,
                    "mm",
                    at_most(paper),
                )


def test_the_papers_estimator_comes_within_a_factor_of_two_of_its_figure(study, figure) -> None:
    """With the best of the sets of orientations that are swept, by the median of the draws that end."""
    best = min(study.sweep, key=lambda one: one.noisy.paper_mm)
    words = (
        f"five points, eleven orientations, paper's estimator: {best.angles}, {best.amplitude_deg:g} deg"
    )
    figure(words, best.noisy.paper_mm, "mm", between(PAPER_NOISY_MM / 2.0, 2.0 * PAPER_NOISY_MM))
