"""``hexacell study``: what was published of the method, repeated on simulated robots.

A new study is one more row of the table of all, and one of the command's arguments.
"""

import argparse
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from pydantic_core import to_jsonable_python

from hexacell.cli.console import Console
from hexacell.cli.progress import task_bar
from hexacell.errors import ExitCode
from hexacell.storage.output_files import PICTURE, PICTURE_MARK, OutputFile
from hexacell.study import paper_experiment as experiment
from hexacell.study import paper_simulation as simulation
from hexacell.study.tasks import Study, processes, run_study
from hexacell.text import paper_study


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
