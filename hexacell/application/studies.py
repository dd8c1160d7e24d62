"""A study carried out by this computer's processors, its results kept as they come."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from hexacell.errors import FileError
from hexacell.storage import atomic_files
from hexacell.study.paper_simulation import Outcome, carry_out
from hexacell.study.paper_summary import PaperStudy, summary, trials_of
from hexacell.study.tasks import results_of

RESULTS = "paper.jsonl"
OnProgress = Callable[[int, int], None]
"""Told how many tasks of how many are done."""

NewExecutor = Callable[[], Executor]


class _Kept(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")

    key: str
    outcome: Outcome


_KEPT = TypeAdapter(_Kept)


def study_paper(folder: Path, draws: int, new_executor: NewExecutor, told: OnProgress) -> PaperStudy:
    """The paper's simulations; what ``folder`` has of them already is not computed again.

    Args:
        folder: gets a line for each trial, in ``paper.jsonl``.
        draws: of the orientations and of the noise, for each kind of trial.
        new_executor: what carries out the trials, such as :func:`processes`; another one where it breaks.
        told: of the progress.

    Raises:
        FileError: the folder cannot be written, or has another file of that name.
    """
    trials, path = trials_of(draws), folder / RESULTS
    atomic_files.create_folder_durably(folder)
    known = {key: outcome for key, outcome in _known(path).items() if key in trials}
    told(len(known), len(trials))
    try:
        with path.open("a", encoding="utf-8") as kept:
            for key, outcome in results_of(trials, carry_out, new_executor, done=set(known)):
                known[key] = outcome
                kept.write(_KEPT.dump_json(_Kept(key=key, outcome=outcome)).decode() + "\n")
                kept.flush()
                told(len(known), len(trials))
    except OSError as error:
        raise atomic_files.os_error_to_file_error("cannot be written", path, error) from error
    return summary(trials, known)


def _known(path: Path) -> dict[str, Outcome]:
    """What was kept; a last line that was not finished is computed again."""
    if not path.exists():
        return {}
    *lines, rest = path.read_text(encoding="utf-8").split("\n")
    found = {}
    for number, line in enumerate(lines, start=1):
        try:
            kept = _KEPT.validate_json(line)
        except ValidationError as error:
            raise FileError(
                "this is no result of this study", subject=path, line=number, action="Name another folder"
            ) from error
        found[kept.key] = kept.outcome
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
