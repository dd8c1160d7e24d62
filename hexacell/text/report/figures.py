"""The pictures of a report, drawn as SVG text that is the same, byte for byte, whenever it is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np

from hexacell.kinematics.rotations import Array
from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.report.blocks import Chapter, Picture
from hexacell.text.svg_drawing import AFTER, BEFORE, INK, SMALLEST_MM, as_svg, new_figure
from hexacell.uncertainty.statement import COVERAGE_FACTOR
from procedures.run.steps import Phase

PLACE = (0.12, 0.17, 0.87, 0.72)
"""Of the axes in a figure; to find the best one would draw each figure twice."""

LABELS_PT = 300.0
"""For all labels of parameters side by side; with more of them they are smaller."""


def figure_chapter(run: ReportedRun) -> Chapter | None:
    """The ball's deviations before and after, and how well the records agree; none without records."""
    pictures = tuple(one for one in (_deviations(run), _changes(run)) if one is not None)
    return Chapter("Figures", pictures) if pictures else None


def _deviations(run: ReportedRun) -> Picture | None:
    """As figures 8 and 9 of the paper: what the gauges show at each held-out pose."""
    phases = (("as found", Phase.BEFORE, BEFORE, "o"), ("as left", Phase.AFTER, AFTER, "s"))
    series = [(name, _distances(run, phase), colour, marker) for name, phase, colour, marker in phases]
    if not any(len(distances) for _, distances, _, _ in series):
        return None
    figure, axes = _axes()
    for name, distances, colour, marker in series:
        numbers = np.arange(1, len(distances) + 1)
        axes.semilogy(numbers, distances, marker, color=colour, label=name, markersize=5)
    axes.set_xlabel("held-out pose")
    axes.set_ylabel("deviation of the ball, mm")
    axes.grid(visible=True, axis="y", color="#dddddd", linewidth=0.6)
    axes.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    return Picture(as_svg(figure), "Distance of the ball from its reference at each held-out pose.")


def _distances(run: ReportedRun, phase: Phase) -> Array:
    deviations = np.array(run.state.held_out(phase), dtype=float).reshape(-1, 3)
    distances: Array = np.maximum(np.linalg.norm(deviations, axis=-1), SMALLEST_MM)
    return distances


def _changes(run: ReportedRun) -> Picture | None:
    """The change of each free parameter by its expanded uncertainty."""
    identified = run.state.identified
    if identified is None:
        return None
    mechanism = run.settings.mechanism
    parameters = mechanism.parameters
    old, units = run.geometry_before.vector, parameters.like_a_mm
    sigma = parameters.vector(identified.result.sigma) / units
    rows = np.flatnonzero(sigma > 0.0)
    change = ((parameters.vector(identified.result.geometry) - old) / units)[rows]
    figure, axes = _axes()
    axes.errorbar(
        np.arange(len(rows)),
        change,
        yerr=COVERAGE_FACTOR * sigma[rows],
        fmt="o",
        color=AFTER,
        markersize=3.5,
        capsize=2,
    )
    axes.axhline(0.0, color=INK, linewidth=0.6)
    names = [parameters.parameters[row].name for row in rows]
    axes.set_xticks(np.arange(len(rows)), names, rotation=90, fontsize=min(9.0, LABELS_PT / len(rows)))
    axes.set_ylabel(f"change, {' or '.join(dict.fromkeys(kind.unit.shown for kind in parameters.kinds))}")
    return Picture(as_svg(figure), "Change of each parameter, with its expanded uncertainty (k = 2).")


def _axes() -> tuple[Any, Any]:
    """A figure and its axes."""
    figure, [axes] = new_figure((7.0, 2.8), PLACE)
    return figure, axes
