"""The last accepted result of a cell: what is known of the geometry that its controller runs with."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.controller_config.change import fingerprint
from hexacell.controller_config.write_back import Receipt
from hexacell.decision import Verdict
from hexacell.errors import HexacellError
from hexacell.kinematics.rotations import Array
from hexacell.runs.run_folder import RunFolder, runs_folder
from procedures.journal.journal import read_entries
from procedures.run.state import fold


@dataclass(frozen=True, slots=True, eq=False)
class AcceptedResult:
    """A result that was written to the controller and passed.

    Attributes:
        run: its run folder.
        covariance: of the identified parameters (P, P), mm^2, in the mechanism's frame convention.
        at: when its run ended.
    """

    run: Path
    covariance: Array
    at: datetime


def last_accepted_result(cell: Cell) -> AcceptedResult | None:
    """The newest accepted result whose config is the one that the controller has now, byte for byte.

    Runs whose files cannot be read are left out.

    Raises:
        FileError: the controller's config cannot be read.
    """
    written = fingerprint(cell.config_path)
    folder = runs_folder(cell)
    paths = sorted(folder.iterdir()) if folder.is_dir() else []
    found = (_accepted(RunFolder(path)) for path in paths if _wrote(path, written))
    return max((one for one in found if one is not None), key=lambda one: one.at, default=None)


def _wrote(path: Path, sha256: str) -> bool:
    """Whether a run wrote the config with this fingerprint."""
    try:
        return Receipt.of(path).sha256_after == sha256
    except HexacellError:
        return False


def _accepted(folder: RunFolder) -> AcceptedResult | None:
    """The result of a run, if it passed and stayed in the controller."""
    try:
        entries = read_entries(folder.journal)
    except HexacellError:
        return None
    state = fold(entry.event for entry in entries)
    passed = state.judged is not None and state.judged.verdict is Verdict.PASS
    if not passed or state.identified is None or state.rolled_back or state.rolling_back:
        return None
    return AcceptedResult(folder.path, np.array(state.identified.result.covariance), entries[-1].at)
