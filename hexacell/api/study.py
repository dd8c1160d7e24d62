"""The studies of ``hexacell study``, from Python."""

import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from hexacell.errors import UsageError
from hexacell.study.tasks import processes, run_study

STUDIES = {"paper": ("paper_simulation", "PAPER"), "experiment": ("paper_experiment", "EXPERIMENT")}


def study(name: str, draws: int, *, folder: Path | str | None = None, workers: int = 1) -> Any:  # noqa: ANN401 - a dataclass, as the study has it
    """What a study on simulated robots found, in the fields of ``hexacell study --json``.

    Args:
        name: ``paper`` or ``experiment``.
        draws: number of draws of the orientations and the noise.
        folder: where results are kept, so that it goes on where it was; by default a new temporary one.
        workers: 1 computes in this process, more in processes of their own, which import a script anew.
    """
    if name not in STUDIES:
        raise UsageError(f"there is no study '{name}'", action=f"There are: {', '.join(STUDIES)}")
    module, row = STUDIES[name]
    executor = processes(workers) if workers > 1 else partial(ThreadPoolExecutor, 1)
    kept = Path(folder or tempfile.mkdtemp(prefix="hexacell-study-"))
    found = getattr(import_module(f"hexacell.study.{module}"), row)
    return run_study(found, kept, draws, executor, lambda done, of: None)  # noqa: ARG005 - nobody looks
