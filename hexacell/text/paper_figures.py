"""Figures 4 and 5 of the paper, drawn again: as SVG text that is the same whenever it is drawn."""

from __future__ import annotations

from math import isfinite

from hexacell.study.paper_summary import FIGURES, PAPER_NOISY_MM, PaperStudy
from hexacell.text.svg_drawing import AFTER, BEFORE, SMALLEST_MM, as_svg, new_figure


def study_picture(study: PaperStudy) -> str:
    """Both beside each other: the largest error of a parameter by the number of points."""
    places = [(0.10 + 0.47 * place, 0.16, 0.40, 0.70) for place in range(len(study.figures))]
    figure, both = new_figure((7.0, 3.0), *places)
    both[0].set_ylabel("largest error of a parameter, mm")
    for axes, (number, sets) in zip(both, study.figures.items(), strict=True):
        for estimator, colour, marker in (("paper", BEFORE, "o"), ("ours", AFTER, "s")):
            for noise, line in (("noisy", "-"), ("exact", ":")):
                errors = [getattr(getattr(one, noise), f"{estimator}_mm") for one in sets]
                shown = [
                    (one.points, max(error, SMALLEST_MM))
                    for one, error in zip(sets, errors, strict=True)
                    if isfinite(error)
                ]
                name = f"{estimator}, {'0.01 mm of noise' if noise == 'noisy' else 'no noise'}"
                x, y = zip(*shown, strict=True) if shown else ((), ())
                axes.semilogy(x, y, marker + line, color=colour, label=name, markersize=4)
        told = "the paper of figure 4, 5 points, noise"
        axes.axhline(PAPER_NOISY_MM, color="#888888", linewidth=0.6, label=told)
        axes.set_xticks(range(1, 6))
        axes.set_xlim(0.8, 5.2)
        axes.set_ylim(0.5 * SMALLEST_MM, 100.0)
        axes.set_xlabel("points")
        axes.set_title(f"Figure {number}: {FIGURES[number]} orientations", fontsize=9)
    both[0].legend(frameon=False, fontsize=7)
    return as_svg(figure)
