"""A study carried out by this computer's processors, its results kept as they come."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Generic, cast

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from hexacell.errors import FileError
from hexacell.storage import atomic_files
from hexacell.study.tasks import ResultType, Study, SummaryType, TaskType, results_of

OnProgress = Callable[[int, int], None]
"""Called with the number of tasks that are done, and of all tasks."""

NewExecutor = Callable[[], Executor]


class _Kept(BaseModel, Generic[ResultType]):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")

    key: str
    outcome: ResultType


def run_study(
    study: Study[TaskType, ResultType, SummaryType],
    folder: Path,
    draws: int,
    new_executor: NewExecutor,
    on_progress: OnProgress,
) -> SummaryType:
    """The summary of a study; results that ``folder`` has already are not computed again.

    Args:
        study: one of them.
        folder: gets a line for each task, in a file ``.jsonl`` named after the study.
        draws: as many as the study is to make.
        new_executor: what carries out the tasks, such as :func:`processes`; another one where it breaks.
        on_progress: called after every task.

    Raises:
        FileError: the folder cannot be written, or has another file of that name.
        WorkersLost: executors break one after the other.
    """
    tasks = study.tasks_of(draws)
    path = folder / f"{study.name}.jsonl"
    kept = TypeAdapter(cast("type[_Kept[ResultType]]", _Kept.__class_getitem__(study.result_type)))
    atomic_files.create_folder_durably(folder)
    results = {key: result for key, result in _known(path, kept).items() if key in tasks}
    on_progress(len(results), len(tasks))
    try:
        with path.open("a", encoding="utf-8") as file:
            for key, result in results_of(tasks, study.carry_out, new_executor, done=set(results)):
                results[key] = result
                file.write(kept.dump_json(_Kept(key=key, outcome=result)).decode() + "\n")
                file.flush()
                on_progress(len(results), len(tasks))
    except OSError as error:
        raise atomic_files.os_error_to_file_error("cannot be written", path, error) from error
    return study.summary(tasks, results)


def _known(path: Path, kept: TypeAdapter[_Kept[ResultType]]) -> dict[str, ResultType]:
    """The results that were kept; a last line that was not finished is computed again."""
    if not path.exists():
        return {}
    *lines, rest = path.read_text(encoding="utf-8").split("\n")
    found = {}
    for number, line in enumerate(lines, start=1):
        try:
            result = kept.validate_json(line)
        except ValidationError as error:
            raise FileError(
                "this is not a result of this study",
                subject=path,
                line=number,
                action="Name another folder",
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
