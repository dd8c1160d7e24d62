"""The paper's simulations and experiment as text, documents and pictures, beside what the paper says."""

from collections.abc import Iterator
from math import isfinite

from hexacell.study import paper_experiment as experiment
from hexacell.study import paper_simulation as simulation
from hexacell.text.layout import wrapped
from hexacell.text.svg_drawing import AFTER, BEFORE, SMALLEST_MM, as_svg, columns, new_figure

WHAT_THE_PAPER_SAYS = {
    4: f"The paper: one point never; two or more without noise {simulation.PAPER_EXACT_MM:g} mm, after a "
    f"limited number of steps; five with noise {simulation.PAPER_NOISY_MM:g} mm.",
    5: "The paper: not with two or three points; errors fall with the number of points.",
}
OPEN = (
    "The paper leaves open where its points are, which orientations it takes, what their angles mean and "
    f"when it stops. Here: P1 to P5 of its Table 3; each of three angles within "
    f"+-{simulation.AMPLITUDE_DEG:g} deg, about fixed axes; until a step is below 1e-6 mm."
)
NO_GAUGE = (
    "No dial gauge shows such deviations. `hexacell demo` stays within 12.5 mm of travel: it turns the "
    "platform as far as what is known so far allows."
)
HEAD = f"  {'points':<8} {'without noise: P, ours':<26} {'with noise: P, ours there, ours':<32} deviation"


def study_lines(study: simulation.PaperStudy) -> Iterator[str]:
    """The whole of it, in lines of at most 80 columns."""
    yield wrapped(OPEN)
    for figure, sets in study.figures.items():
        yield ""
        yield wrapped(
            f"Figure {figure}: largest error of a parameter, mm; {simulation.FIGURES[figure]} "
            f"orientations at each point, +-{simulation.AMPLITUDE_DEG:g} deg; medians of "
            f"{sets[0].noisy.trials} draws. P is the paper's estimator, in brackets in how many draws it "
            "comes to an end; then ours of the same draws, and of all. The deviation is what gauges would "
            "have to show."
        )
        yield HEAD
        for one in sets:
            both = f"{_accuracy(one.exact):<26} {_in_full(one.noisy):<32}"
            yield f"  {one.points:<8} {both} {one.deviation_mm:.0f} mm"
        yield wrapped(WHAT_THE_PAPER_SAYS[figure])
    yield ""
    yield wrapped("Table 2: 5 points, 11 orientations, noise of 0.01 mm; largest errors by kinds, mm.")
    yield "  parameters   in the paper   paper's estimator   ours"
    for kind, found in study.table_2.items():
        both = f"{_number(found['paper_mm']):<19} {_number(found['ours_mm'])}"
        yield f"  {kind:<12} {simulation.PAPER_TABLE_2_MM[kind]:<14.3f} {both}"
    yield ""
    yield wrapped(NO_GAUGE)


def _accuracy(one: simulation.MedianErrors) -> str:
    """The errors of both estimators: ``1.51 (12), 0.48``."""
    ours = "refused" if one.refused == one.trials else _number(one.ours_mm)
    paper = f"{_number(one.paper_mm)} ({one.settled})" if one.settled else "none"
    return f"{paper}, {ours}"


def _in_full(one: simulation.MedianErrors) -> str:
    """The errors with ours of the same draws between: ``1.51 (12), 0.48, 0.52``."""
    paper, _, ours = _accuracy(one).rpartition(", ")
    return f"{paper}, {_number(one.ours_there_mm)}, {ours}" if one.settled else f"{paper}, {ours}"


def _number(value: float) -> str:
    if not isfinite(value):
        return "-"
    return f"{value:.0e}" if value < 1e-3 else f"{value:.2f}" if value < 100.0 else f"{value:.0f}"


def study_picture(study: simulation.PaperStudy) -> str:
    """Figures 4 and 5 beside each other: the largest error of a parameter by the number of points."""
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
                axes.semilogy(*columns(shown), marker + line, color=colour, label=name, markersize=4)
        label = "the paper of figure 4, 5 points, noise"
        axes.axhline(simulation.PAPER_NOISY_MM, color="#888888", linewidth=0.6, label=label)
        axes.set_xticks(range(1, 6))
        axes.set_xlim(0.8, 5.2)
        axes.set_ylim(0.5 * SMALLEST_MM, 100.0)
        axes.set_xlabel("points")
        axes.set_title(f"Figure {number}: {simulation.FIGURES[number]} orientations", fontsize=9)
    both[0].legend(frameon=False, fontsize=7)
    return as_svg(figure)


def experiment_lines(study: experiment.ExperimentStudy) -> Iterator[str]:
    """The whole of it, in lines of at most 80 columns."""
    yield wrapped(
        "Mean distance of the ball from its first place at a point, mm, and by what share it falls: "
        f"{experiment.ORIENTATIONS} orientations within +-{experiment.AMPLITUDE_DEG:g} deg, medians of "
        f"{study.rows[0].draws} draws. P1 to P3 calibrate, P4 to P6 verify. P is the paper's estimator, "
        "which ends in so many; chosen: ours from as many orientations within "
        f"+-{experiment.CHOSEN_WITHIN_DEG:g} deg that it chose itself. The robot's geometry is what the "
        "paper identified; the first column is its repeatability, the standard deviation of each "
        "coordinate of the ball."
    )
    yield ""
    yield f"  {'':<11} {'P1 to P3':<38} P4 to P6"
    head = f"{'before':<6} {'P':<11} {'ours':<11} chosen"
    yield f"  {'mm':<6} {'ends':<4} {head:<38} {head}".rstrip()
    for row in study.rows:
        both = f"{_reduction(row.calibrating):<38} {_reduction(row.verifying)}"
        yield f"  {row.repeatability_mm:<6g} {row.ended:<4} {both}".rstrip()
    yield ""
    yield wrapped(
        f"The paper: more than {100 * experiment.PAPER_REDUCTION:.0f} percent less, with a repeatability "
        f"of about {experiment.PAPER_REPEATABILITY_MM:g} mm; better with a better one."
    )
    coarsest = study.rows[-1]
    most = 100 * (1 - coarsest.floor_mm / coarsest.verifying.before)
    ratios = ", ".join(
        f"{row.verifying.ours / row.floor_mm:.2f} ({row.verifying.chosen / row.floor_mm:.2f}) at "
        f"{row.repeatability_mm:g} mm"
        for row in reversed(study.rows)
    )
    yield wrapped(
        f"Two places that scatter are {experiment.MEAN_DISTANCE:.2f} times the repeatability apart in the "
        f"mean, whatever the geometry: at {coarsest.repeatability_mm:g} mm nobody can have more than "
        f"{most:.0f} percent less. Ours (chosen) over that floor at P4 to P6: {ratios}."
    )


def _reduction(one: experiment.Reduction) -> str:
    paper, ours = (
        f"{value:.3f} -{100 * (1 - value / one.before):.1f}%" if isfinite(value) else "-"
        for value in (one.paper, one.ours)
    )
    return f"{one.before:<6.2f} {paper:<11} {ours:<11} {one.chosen:.3f}"


def experiment_picture(study: experiment.ExperimentStudy) -> str:
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
