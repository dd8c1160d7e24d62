"""A study: independent tasks, carried out by any executor, and what their results say together.

Each task has its own seed, so it does not matter who does it. Where a worker dies, what it and the others
had begun is done again; only a task that has ended its worker several times is given up.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from dataclasses import dataclass
from typing import Generic, TypeVar

from hexacell.errors import HexacellError

TaskType = TypeVar("TaskType")
ResultType = TypeVar("ResultType")
SummaryType = TypeVar("SummaryType")

MOST_LOSSES = 5
"""Executors that may break in a row without a single result."""


@dataclass(frozen=True, slots=True)
class Study(Generic[TaskType, ResultType, SummaryType]):
    """Independent tasks, and what their results say together.

    Attributes:
        name: name of its command and its files.
        unit: word for its tasks, in the plural.
        tasks_of: all tasks by their keys, for a number of draws. Each has its own seed.
        carry_out: a task's result; a function of a module, since other processes import it.
        result_type: class of the results, a dataclass, which is kept as JSON.
        summary: gives the summary of all tasks and their results, by the same keys.
    """

    name: str
    unit: str
    tasks_of: Callable[[int], Mapping[str, TaskType]]
    carry_out: Callable[[TaskType], ResultType]
    result_type: type[ResultType]
    summary: Callable[[Mapping[str, TaskType], Mapping[str, ResultType]], SummaryType]


class WorkersLost(HexacellError):
    """The workers of a study die, whatever they are given."""


def results_of(
    tasks: Mapping[str, TaskType],
    carry_out: Callable[[TaskType], ResultType],
    new_executor: Callable[[], Executor],
    *,
    done: Collection[str] = (),
) -> Iterator[tuple[str, ResultType]]:
    """Each task's key and result as they come, without those that are done already.

    Raises:
        WorkersLost: executors break one after the other.
        Exception: whatever a task raises.
    """
    left = {key: task for key, task in tasks.items() if key not in done}
    losses = 0
    while left:
        count = len(left)
        for key, result in _until_broken(left, carry_out, new_executor):
            del left[key]
            yield key, result
        losses = losses + 1 if len(left) == count else 0
        if losses == MOST_LOSSES:
            raise WorkersLost(
                f"{losses} sets of workers ended without a result", action="Give them more memory"
            )


def _until_broken(
    left: Mapping[str, TaskType],
    carry_out: Callable[[TaskType], ResultType],
    new_executor: Callable[[], Executor],
) -> Iterator[tuple[str, ResultType]]:
    executor = new_executor()
    keys: dict[Future[ResultType], str] = {}
    try:
        keys = {executor.submit(carry_out, task): key for key, task in left.items()}
        for future in as_completed(keys):
            yield keys[future], future.result()
    except BrokenExecutor:
        return
    finally:
        executor.shutdown(wait=True, cancel_futures=True)
