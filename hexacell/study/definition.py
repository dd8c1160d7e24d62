"""What a study consists of, whoever carries it out and however it is shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

TaskType = TypeVar("TaskType")
ResultType = TypeVar("ResultType")
SummaryType = TypeVar("SummaryType")


@dataclass(frozen=True, slots=True)
class Study(Generic[TaskType, ResultType, SummaryType]):
    """Independent tasks, and what their results say together.

    Attributes:
        name: of its command and its files.
        unit: what a task is, in the plural.
        tasks_of: all tasks by their keys, for a number of draws. Each has its own seed.
        carry_out: a task's result; a function of a module, since other processes import it.
        result_type: of that, a dataclass, which is kept as JSON.
        summary: of all tasks and their results, by the same keys.
    """

    name: str
    unit: str
    tasks_of: Callable[[int], Mapping[str, TaskType]]
    carry_out: Callable[[TaskType], ResultType]
    result_type: type[ResultType]
    summary: Callable[[Mapping[str, TaskType], Mapping[str, ResultType]], SummaryType]
