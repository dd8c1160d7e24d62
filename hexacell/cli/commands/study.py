"""``hexacell study``: what was published of the method, repeated on simulated robots.

A new study is one more row of the table of all, and one of the command's arguments.
"""

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from math import isfinite
from typing import Any

from pydantic_core import to_jsonable_python

from hexacell.cli.console import Console
from hexacell.cli.progress import task_bar
from hexacell.errors import ExitCode
from hexacell.storage.output_files import PICTURE, PICTURE_MARK, OutputFile
from hexacell.study import paper_experiment as experiment
from hexacell.study import paper_simulation as simulation
from hexacell.study.design_records import PAPER_DEG, RANDOM_DEG, OrientationChoice
from hexacell.study.design_study import DESIGN, DesignStudy, Spread
from hexacell.study.tasks import Study, processes, run_study
from hexacell.text import paper_study
from hexacell.text.layout import wrapped
from hexacell.text.svg_drawing import AFTER, BEFORE, INK, as_svg, columns, new_figure, plain_ticks

WAYS = (
    "adaptive: this program's, through the controller's own wrong geometry at first. best fixed: selected "
    "by a designer who knows the robot, and commanded with its geometry. sifted random: angles within "
    f"+-{RANDOM_DEG[0]:g} deg, of which those are kept that stay inside the travel. random: angles as "
    f"large as all of them stay inside. paper: angles within +-{PAPER_DEG:g} deg and any deviation."
)
GREY = "#777777"
HEADROOM = 1.08
"""Factor by which an axis that begins at zero is longer than the largest value."""
STYLES = {
    OrientationChoice.ADAPTIVE: (AFTER, "s", "-"),
    OrientationChoice.FIXED: (INK, "^", "--"),
    OrientationChoice.SIFTED: (BEFORE, "v", ":"),
    OrientationChoice.RANDOM: (BEFORE, "o", "-"),
    OrientationChoice.PAPER: (GREY, "D", "-."),
}


@dataclass(frozen=True, slots=True)
class ShownStudy:
    """A study, its summary as lines of text and as a picture (SVG), and what is stated beside it."""

    study: Study[Any, Any, Any]
    lines: Callable[[Any], Iterable[str]]
    picture: Callable[[Any], str]
    stated: Mapping[str, object] = field(default_factory=dict)

    def document(self, summary: Any) -> dict[str, Any]:  # noqa: ANN401 - a dataclass, as the study has it
        """All figures as a JSON document; what is not finite is null."""
        figures = {**self.stated, **asdict(summary)}
        document: dict[str, Any] = to_jsonable_python(figures, inf_nan_mode="null")
        return document


def design_lines(study: DesignStudy) -> Iterator[str]:
    """The whole of it, in lines of at most 80 columns."""
    yield wrapped(
        "Largest error of a parameter, mm: the median of the robots, in brackets what 90 % stay within; "
        "the noise on the parameters (rms), the error at the worst task pose (one sigma), the largest "
        "deviation; how many robots of how many."
    )
    yield wrapped(WAYS)
    yield ""
    head = f"{'error':<16} {'noise':<8} {'task':<8} {'gauges':<9} robots"
    yield f"  {'orientations':<15} {'records':<8} {head}"
    for name, curve in study.choices.items():
        if not curve.by_records:
            yield f"  {name:<15} none of {curve.tried} robots is identified"
        for count, spread in curve.by_records.items():
            robots = f"{curve.deviation_mm:<9.3g} {spread.robots}/{curve.tried}"
            yield f"  {name:<15} {count:<8} {_spread(spread)} {robots}"
    if ratios := ", ".join(f"{name} {ratio:.1f}" for name, ratio in study.noise_ratio.items()):
        yield wrapped(f"Noise on the parameters, times that of adaptive orientations: {ratios}.")
    for name, rows in study.sweeps.items():
        yield ""
        yield f"  {name:<24} {'error':<16} {'noise':<8} {'task':<8} robots"
        for value, spread in rows.items():
            yield f"  {value:<24g} {_spread(spread)} {spread.robots}"


def _spread(one: Spread) -> str:
    error = f"{one.largest_mm:.3g} ({one.most_mm:.3g})"
    return f"{error:<16} {one.sigma_mm:<8.3g} {one.task_mm:<8.3g}"


def design_picture(study: DesignStudy) -> str:
    """The largest error by the number of records, and adaptive campaigns by what limits them."""
    small = [(0.11 + 0.23 * place, 0.10, 0.16, 0.26) for place in range(len(study.sweeps))]
    figure, (large, *others) = new_figure((7.2, 5.2), (0.11, 0.50, 0.86, 0.44), *small)
    for name, curve in study.choices.items():
        colour, marker, line = STYLES[OrientationChoice(name)]
        # A number of records that few robots have says more of these robots than of the number.
        errors = [
            (count, one.largest_mm)
            for count, one in curve.by_records.items()
            if 2 * one.robots > curve.tried
        ]
        large.semilogy(*columns(errors), marker + line, color=colour, label=name, markersize=4)
    large.set_xlabel("records")
    large.set_ylabel("largest error of a parameter, mm")
    large.legend(
        frameon=False, fontsize=7, ncols=len(STYLES), loc="lower center", bbox_to_anchor=(0.5, 1.0)
    )
    plain_ticks(large.yaxis)
    for axes, (name, rows) in zip(others, study.sweeps.items(), strict=True):
        _draw_sweep(axes, name, rows)
    others[0].set_ylabel("error at the task, mm")
    return as_svg(figure)


def _draw_sweep(axes: Any, name: str, rows: Mapping[float, Spread]) -> None:  # noqa: ANN401 - matplotlib's
    x, y = columns([(value, one.task_mm) for value, one in rows.items() if isfinite(one.task_mm)])
    axes.plot(x, y, "s-", color=AFTER, markersize=4)
    axes.set_xlabel(name)
    if name.startswith("noise"):
        axes.set_xscale("log")
        axes.set_yscale("log")
        plain_ticks(axes.yaxis)
        plain_ticks(axes.xaxis)
        axes.set_xticks(x[::2])
    else:
        axes.set_ylim(0.0, HEADROOM * max(y, default=1.0))
    axes.tick_params(labelsize=7)


_ROWS = (
    ShownStudy(
        simulation.PAPER,
        paper_study.study_lines,
        paper_study.study_picture,
        {
            "noise_mm": simulation.NOISE_MM,
            "paper": {
                "exact_mm": simulation.PAPER_EXACT_MM,
                "noisy_mm": simulation.PAPER_NOISY_MM,
                "table_2_mm": simulation.PAPER_TABLE_2_MM,
            },
        },
    ),
    ShownStudy(
        experiment.EXPERIMENT,
        paper_study.experiment_lines,
        paper_study.experiment_picture,
        {
            "paper": {
                "reduction": experiment.PAPER_REDUCTION,
                "repeatability_mm": experiment.PAPER_REPEATABILITY_MM,
            }
        },
    ),
    ShownStudy(DESIGN, design_lines, design_picture),
)

STUDIES: Mapping[str, ShownStudy] = {row.study.name: row for row in _ROWS}
"""All studies by their names."""


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """One of the studies; its picture goes into the folder of its results."""
    shown, new_executor = STUDIES[options.study], processes(options.processes)
    picture = OutputFile(options.folder / f"{shown.study.name}.svg", PICTURE)
    picture.require()
    with task_bar(shown.study.unit) as progress:
        found = run_study(shown.study, options.folder, options.draws, new_executor, progress)
    for line in shown.lines(found):
        console.print(line)
    picture.write(shown.picture(found).encode() + PICTURE_MARK)
    console.print(f"\nThe same as a picture: {picture.path}")
    console.document(shown.document(found))
    return ExitCode.DONE
