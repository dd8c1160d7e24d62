"""A study carried out by this computer's processors, its results kept as they come."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from hexacell.errors import FileError
from hexacell.storage import atomic_files
from hexacell.study import paper_experiment, paper_simulation
from hexacell.study.experiment_summary import ExperimentStudy, experiment_summary, experiments_of
from hexacell.study.paper_experiment import ExperimentOutcome
from hexacell.study.paper_simulation import Outcome
from hexacell.study.paper_summary import PaperStudy, summary, trials_of
from hexacell.study.tasks import results_of

OnProgress = Callable[[int, int], None]
"""Told how many tasks of how many are done."""

NewExecutor = Callable[[], Executor]
TaskType = TypeVar("TaskType")
ResultType = TypeVar("ResultType")


class _Kept(BaseModel, Generic[ResultType]):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")

    key: str
    outcome: ResultType


def study_paper(folder: Path, draws: int, new_executor: NewExecutor, told: OnProgress) -> PaperStudy:
    """The paper's simulations; what ``folder`` has of them already is not computed again.

    Args:
        folder: gets a line for each trial, in ``paper.jsonl``.
        draws: of the orientations and of the noise, for each kind of trial.
        new_executor: what carries out the trials, such as :func:`processes`; another one where it breaks.
        told: of the progress.

    Raises:
        FileError: the folder cannot be written, or has another file of that name.
        WorkersLost: executors break one after the other.
    """
    trials, kept = trials_of(draws), TypeAdapter(_Kept[Outcome])
    found = _results(folder / "paper.jsonl", kept, trials, paper_simulation.run_trial, new_executor, told)
    return summary(trials, found)


def study_experiment(
    folder: Path, draws: int, new_executor: NewExecutor, told: OnProgress
) -> ExperimentStudy:
    """The paper's experiment, as :func:`study_paper`; the lines are in ``experiment.jsonl``."""
    experiments, kept = experiments_of(draws), TypeAdapter(_Kept[ExperimentOutcome])
    path = folder / "experiment.jsonl"
    found = _results(path, kept, experiments, paper_experiment.run_experiment, new_executor, told)
    return experiment_summary(experiments, found)


def _results(
    path: Path,
    kept: TypeAdapter[_Kept[ResultType]],
    tasks: Mapping[str, TaskType],
    carry_out: Callable[[TaskType], ResultType],
    new_executor: NewExecutor,
    told: OnProgress,
) -> dict[str, ResultType]:
    """The results of all tasks by their keys, those that were kept among them."""
    atomic_files.create_folder_durably(path.parent)
    known = {key: result for key, result in _known(path, kept).items() if key in tasks}
    told(len(known), len(tasks))
    try:
        with path.open("a", encoding="utf-8") as file:
            for key, result in results_of(tasks, carry_out, new_executor, done=set(known)):
                known[key] = result
                file.write(kept.dump_json(_Kept(key=key, outcome=result)).decode() + "\n")
                file.flush()
                told(len(known), len(tasks))
    except OSError as error:
        raise atomic_files.os_error_to_file_error("cannot be written", path, error) from error
    return known


def _known(path: Path, kept: TypeAdapter[_Kept[ResultType]]) -> dict[str, ResultType]:
    """What was kept; a last line that was not finished is computed again."""
    if not path.exists():
        return {}
    *lines, rest = path.read_text(encoding="utf-8").split("\n")
    found = {}
    for number, line in enumerate(lines, start=1):
        try:
            result = kept.validate_json(line)
        except ValidationError as error:
            raise FileError(
                "this is no result of this study", subject=path, line=number, action="Name another folder"
            ) from error
        found[result.key] = result.outcome
    if rest:
        path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return found


def processes(count: int | None) -> NewExecutor:
    """Processes of this computer, by default as many as it has processors.

    They leave an interrupt of the terminal to the one that has begun them.
    """
    return partial(
        ProcessPoolExecutor,
        count or os.cpu_count() or 1,
        get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )
