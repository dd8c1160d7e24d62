"""Long computations in a process of their own: keys are heard meanwhile, and quitting ends it at once."""

from __future__ import annotations

import asyncio
import json
import sys
from asyncio.subprocess import DEVNULL, PIPE
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

from hexacell.cell.loader import load_cell
from hexacell.errors import HexacellError
from hexacell.services.offline import try_plan
from hexacell.services.run.calibration_run import preflight
from hexacell.text.planning import device_line, plan_trial_lines
from hexacell.text.screens.live import failed_items, passed_items
from procedures.calibration.calibration import Mode


async def run_child(what: Literal["preflight", "plan"], cell: Path, mode: str = "") -> Any:  # noqa: ANN401 - what JSON can hold
    """The document of a computation about a cell, made by another process.

    Raises:
        HexacellError: it gave no document.
    """
    command = (sys.executable, "-m", __name__, what, str(cell), mode)
    process = await asyncio.create_subprocess_exec(*command, stdin=DEVNULL, stdout=PIPE, stderr=DEVNULL)
    try:
        printed, _ = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    try:
        return json.loads(printed)
    except ValueError as error:
        raise HexacellError(
            "the computation ended without a result", action="Try `hexacell preflight` in another terminal"
        ) from error


def preflight_document(path: Path, mode: Mode) -> dict[str, Any]:
    """The findings of a preflight, and whether a run may begin."""
    try:
        devices = asyncio.run(preflight(load_cell(path), mode, unattended=False))
    except HexacellError as error:
        return {"items": [asdict(item) for item in failed_items(error)], "is_ready": False}
    items = passed_items([device_line(one) for one in devices])
    return {"items": [asdict(item) for item in items], "is_ready": True}


def tried_plan_document(path: Path) -> dict[str, Any]:
    """The forecast of the plan on simulated robots, and its poses; or why it cannot be tried."""
    try:
        trial = try_plan(load_cell(path))
    except HexacellError as error:
        return {"lines": [str(error)], "poses": []}
    poses = [(point, number, pose.as_tuple()) for point, number, pose in trial.result.visited]
    return {"lines": list(plan_trial_lines(trial)), "poses": poses}


if __name__ == "__main__":
    named, file, mode_name = sys.argv[1:]
    found = (
        tried_plan_document(Path(file))
        if named == "plan"
        else preflight_document(Path(file), Mode(mode_name))
    )
    sys.stdout.write(json.dumps(found))
