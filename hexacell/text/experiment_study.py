"""The paper's experiment as text, as a document and as figures 8 and 9."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from math import isfinite
from typing import Any

from hexacell.study.experiment_summary import (
    PAPER_REDUCTION,
    PAPER_REPEATABILITY_MM,
    ExperimentStudy,
    Reduction,
    RepeatabilityRow,
)
from hexacell.study.paper_experiment import AMPLITUDE_DEG, ORIENTATIONS
from hexacell.text.layout import wrapped
from hexacell.text.svg_drawing import AFTER, BEFORE, as_svg, new_figure


def experiment_lines(study: ExperimentStudy) -> Iterator[str]:
    """The whole of it, in lines of at most 80 columns."""
    yield wrapped(
        "Mean distance of the ball from its first place at a point, mm, and by what share it falls: "
        f"{ORIENTATIONS} orientations within +-{AMPLITUDE_DEG:g} deg, medians of {study.rows[0].draws} "
        "draws. P1 to P3 calibrate, P4 to P6 verify. P is the paper's estimator, which ends in so many. "
        "The robot's geometry is what the paper identified; the first column is its repeatability, the "
        "standard deviation of each coordinate of the ball."
    )
    yield ""
    yield f"  {'':<11} {'P1 to P3':<32} P4 to P6"
    head = _columns("before", "P", "ours")
    yield f"  {'mm':<6} {'ends':<4} {head:<32} {head}".rstrip()
    for row in study.rows:
        yield _line(row)
    yield ""
    yield wrapped(
        f"The paper: more than {100 * PAPER_REDUCTION:.0f} percent less, with a repeatability of about "
        f"{PAPER_REPEATABILITY_MM:g} mm; better with a better one."
    )


def _line(row: RepeatabilityRow) -> str:
    both = f"{_reduction(row.calibrating):<32} {_reduction(row.verifying)}"
    return f"  {row.repeatability_mm:<6g} {row.ended:<4} {both}".rstrip()


def _reduction(one: Reduction) -> str:
    return _columns(f"{one.before:.2f}", _after(one.paper, one.before), _after(one.ours, one.before))


def _columns(before: str, paper: str, ours: str) -> str:
    return f"{before:<6} {paper:<12} {ours:<12}"


def _after(value: float, before: float) -> str:
    return f"{value:.3f} -{100 * (1 - value / before):.1f}%" if isfinite(value) else "-"


def experiment_document(study: ExperimentStudy) -> dict[str, Any]:
    """All figures as a JSON document; what is not finite is null."""
    return {
        "paper": {"reduction": PAPER_REDUCTION, "repeatability_mm": PAPER_REPEATABILITY_MM},
        "rows": [
            asdict(row) | {name: _document(getattr(row, name)) for name in ("calibrating", "verifying")}
            for row in study.rows
        ],
        "example": asdict(study.example),
    }


def _document(one: Reduction) -> dict[str, float | None]:
    return {name: value if isfinite(value) else None for name, value in asdict(one).items()}


def experiment_picture(study: ExperimentStudy) -> str:
    """Figures 8 and 9: each orientation's distance from the first, before and after, in one draw."""
    places = [(0.09 + 0.48 * place, 0.16, 0.42, 0.70) for place in range(2)]
    figure, both = new_figure((7.0, 3.0), *places)
    parts = (
        ("Figure 8: P1 to P3", study.example.calibrating),
        ("Figure 9: P4 to P6", study.example.verifying),
    )
    for axes, (title, part) in zip(both, parts, strict=True):
        numbers = range(1, len(part.before) + 1)
        axes.plot(numbers, part.before, "o", color=BEFORE, label="before", markersize=3)
        axes.plot(numbers, part.ours, "s", color=AFTER, label="after, ours", markersize=3)
        axes.set_xlabel("orientation")
        axes.set_title(title, fontsize=9)
    both[0].set_ylabel("distance from the first, mm")
    both[0].legend(frameon=False, fontsize=7)
    return as_svg(figure)
