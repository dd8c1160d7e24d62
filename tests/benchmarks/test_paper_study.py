"""``hexacell study paper`` at its full size: the paper's figures in shape, and ours better."""

from itertools import pairwise
from math import isfinite, isnan

from hexacell.study.paper_simulation import PAPER, PAPER_EXACT_MM
from hexacell.study.tasks import processes, run_study
from tests.benchmarks.figures import at_least, at_most
from tests.benchmarks.samples import sample

DRAWS = sample(__name__, "DRAWS")


def test_the_papers_figures_in_shape_and_ours_better(figure, tmp_path) -> None:
    study = run_study(PAPER, tmp_path, DRAWS, processes(None), lambda *_: None)
    for name, sets in study.figures.items():
        assert not sets[0].exact.paper_mm < 1.0
        refused = sets[0].noisy.refused
        figure(f"figure {name}, one point: ours refuses", refused, f"of {DRAWS}", at_least(DRAWS))
        falling = [one.noisy.ours_mm for one in sets if isfinite(one.noisy.ours_mm)]
        for points, (before, after) in enumerate(pairwise(falling), start=3):
            figure(f"figure {name}, {points} points: ours with noise", after, "mm", at_most(before))
        for one in sets:
            if one.noisy.settled and one.noisy.refused < DRAWS:
                words, paper = f"figure {name}, {one.points} points, same draws", one.noisy.paper_mm
                figure(f"{words}: paper's", paper, "mm")
                figure(f"{words}: ours", one.noisy.ours_there_mm, "mm", at_most(paper))
    for one in study.figures[4][1:]:
        worst = max(one.exact.ours_mm, one.exact.paper_mm if one.exact.settled else 0.0)
        figure(f"figure 4, {one.points} points, no noise", worst, "mm", at_most(PAPER_EXACT_MM))
    for one in study.figures[5][1:3]:
        for who, error in (("paper's", one.exact.paper_mm), ("ours", one.exact.ours_mm)):
            target = None if isnan(error) else at_least(1.0)
            figure(f"figure 5, {one.points} points, no noise: {who}", error, "mm", target)
