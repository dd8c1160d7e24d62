"""A study: independent tasks, carried out by any executor, their results kept as they come.

Each task has its own seed, so it does not matter who does it. Where a worker dies, what it and the others
had begun is done again; only a task that has ended its worker several times is given up.
"""

import os
import signal
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Generic, TypeVar, cast

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from hexacell.errors import FileError, HexacellError
from hexacell.plugins import plugin_failures_named
from hexacell.python_process import keep_working_folder_out_of_workers
from hexacell.storage import atomic_files

TaskType = TypeVar("TaskType", bound=Hashable)
ResultType = TypeVar("ResultType")
SummaryType = TypeVar("SummaryType")

OnProgress = Callable[[int, int], None]
"""Called with the number of tasks that are done, and of all tasks."""

NewExecutor = Callable[[], Executor]

MOST_LOSSES = 5
"""Executors that may break in a row without a single result."""


@dataclass(frozen=True, slots=True)
class Study(Generic[TaskType, ResultType, SummaryType]):
    """Independent tasks, and what their results say together.

    Attributes:
        name: name of its command and its files.
        unit: word for its tasks, in the plural.
        tasks_of: all tasks, dataclasses that can be hashed, for a number of draws. Each has its own seed.
        carry_out: a task's result; a function of a module, since other processes import it.
        result_type: class of the results, a dataclass, which is kept as JSON.
        summary: gives the summary of all results, by their tasks.
    """

    name: str
    unit: str
    tasks_of: Callable[[int], Iterable[TaskType]]
    carry_out: Callable[[TaskType], ResultType]
    result_type: type[ResultType]
    summary: Callable[[Mapping[TaskType, ResultType]], SummaryType]


class WorkersLost(HexacellError):
    """The workers of a study die, whatever they are given."""


def results_of(
    tasks: Iterable[TaskType], carry_out: Callable[[TaskType], ResultType], new_executor: NewExecutor
) -> Iterator[tuple[TaskType, ResultType]]:
    """Each task and its result as they come.

    Raises:
        WorkersLost: executors break one after the other.
        Exception: whatever a task raises.
    """
    left, losses = dict.fromkeys(tasks), 0
    while left:
        count = len(left)
        for task, result in _until_broken(left, carry_out, new_executor):
            del left[task]
            yield task, result
        losses = losses + 1 if len(left) == count else 0
        if losses == MOST_LOSSES:
            raise WorkersLost(
                f"{losses} sets of workers ended without a result", action="Give them more memory"
            )


def _carried_out(carry_out: Callable[[TaskType], ResultType], task: TaskType) -> ResultType:
    """The result, in the process of a worker: another one would learn only the text of what failed."""
    with plugin_failures_named():
        return carry_out(task)


def _until_broken(
    left: Iterable[TaskType], carry_out: Callable[[TaskType], ResultType], new_executor: NewExecutor
) -> Iterator[tuple[TaskType, ResultType]]:
    executor = new_executor()
    try:
        begun = {executor.submit(_carried_out, carry_out, task): task for task in left}
        for future in as_completed(begun):
            yield begun[future], future.result()
    except BrokenExecutor:
        return
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


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

    It gets a line for each task, in a file ``.jsonl`` named after the study. ``new_executor`` gives what
    carries out the tasks, such as :func:`processes`, and another one where that breaks.

    Raises:
        FileError: the folder cannot be written, or has another file of that name.
        WorkersLost: executors break one after the other.
    """
    tasks = {repr(task): task for task in study.tasks_of(draws)}
    path = folder / f"{study.name}.jsonl"
    atomic_files.require_no_link(path)
    kept = TypeAdapter(cast("type[_Kept[ResultType]]", _Kept.__class_getitem__(study.result_type)))
    atomic_files.create_folder_durably(folder)
    results = {tasks[key]: result for key, result in _known(path, kept).items() if key in tasks}
    on_progress(len(results), len(tasks))
    with atomic_files.os_errors("cannot be written", path), path.open("a", encoding="utf-8") as file:
        left = [task for task in tasks.values() if task not in results]
        for task, result in results_of(left, study.carry_out, new_executor):
            results[task] = result
            file.write(kept.dump_json(_Kept(key=repr(task), outcome=result)).decode() + "\n")
            file.flush()
            on_progress(len(results), len(tasks))
    return study.summary(results)


def _known(path: Path, kept: TypeAdapter[_Kept[ResultType]]) -> dict[str, ResultType]:
    """The results that were kept; a last line that was not finished is computed again."""
    if not path.exists():
        return {}
    *lines, rest = atomic_files.read_text(path).split("\n")
    found = {}
    for number, line in enumerate(lines, start=1):
        try:
            result = kept.validate_json(line)
        except ValidationError as error:
            problem = "this is not a result of this study"
            raise FileError(problem, subject=path, line=number, action="Name another folder") from error
        found[result.key] = result.outcome
    if rest and not (found or rest.startswith('{"key":')):
        raise FileError("this is no study", subject=path, action="Name another folder")
    if rest:
        path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return found


def processes(count: int | None) -> NewExecutor:
    """Processes of this computer, by default as many as it has processors.

    They leave an interrupt of the terminal to the one that has begun them.
    """
    keep_working_folder_out_of_workers()
    return partial(
        ProcessPoolExecutor,
        count or os.cpu_count() or 1,
        get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )
