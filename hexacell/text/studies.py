"""All studies and how each is shown: a new one is one more row here, and one of the command's arguments."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from hexacell.study.design_summary import DESIGN
from hexacell.study.paper_experiment import EXPERIMENT
from hexacell.study.paper_simulation import PAPER
from hexacell.study.tasks import Study
from hexacell.text.design_study import design_document, design_lines, design_picture
from hexacell.text.paper_study import (
    experiment_document,
    experiment_lines,
    experiment_picture,
    study_document,
    study_lines,
    study_picture,
)

SummaryType = TypeVar("SummaryType")


@dataclass(frozen=True, slots=True)
class ShownStudy(Generic[SummaryType]):
    """A study, and its summary as lines of text, as a JSON document and as a picture (SVG)."""

    study: Study[Any, Any, SummaryType]
    lines: Callable[[SummaryType], Iterable[str]]
    document: Callable[[SummaryType], dict[str, Any]]
    picture: Callable[[SummaryType], str]


_ROWS: tuple[ShownStudy[Any], ...] = (
    ShownStudy(PAPER, study_lines, study_document, study_picture),
    ShownStudy(EXPERIMENT, experiment_lines, experiment_document, experiment_picture),
    ShownStudy(DESIGN, design_lines, design_document, design_picture),
)

STUDIES: Mapping[str, ShownStudy[Any]] = {row.study.name: row for row in _ROWS}
"""By their names."""
