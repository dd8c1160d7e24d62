"""Long computations in a process of their own: keys are heard meanwhile, and quitting ends it at once."""

import asyncio
import os
import sys
from asyncio.subprocess import DEVNULL, PIPE
from pathlib import Path
from typing import TypeVar

from hexacell.cell.fields import Frozen
from hexacell.cell.loader import load_cell
from hexacell.dry_run.campaign import VisitedPose
from hexacell.errors import HexacellError
from hexacell.plugins import plugin_failures_named
from hexacell.python_process import python_command
from hexacell.services.offline import try_plan
from hexacell.services.run.calibration_run import preflight
from hexacell.text.planning import device_line, plan_trial_lines
from hexacell.text.screens.checklist import checked_items, failed_items
from hexacell.text.screens.views import ChecklistItem, Mark
from procedures.calibration.calibration import Mode


class Preflight(Frozen):
    """What a preflight found, and whether a run may begin."""

    items: tuple[ChecklistItem, ...]
    is_ready: bool


class TriedPlan(Frozen):
    """The forecast of a plan in lines of text, and its poses; empty where it could not be tried."""

    lines: tuple[str, ...] = ()
    poses: tuple[VisitedPose, ...] = ()


LEAST_URGENT = 19
Found = TypeVar("Found", Preflight, TriedPlan)


async def run_child(wanted: type[Found], cell: Path, mode: str = "") -> Found:
    """What a computation about a cell found, made by another process.

    Raises:
        HexacellError: it gave nothing.
    """
    what = "plan" if wanted is TriedPlan else "preflight"
    command = python_command(__name__, what, str(cell), mode)
    process = await asyncio.create_subprocess_exec(*command, stdin=DEVNULL, stdout=PIPE, stderr=DEVNULL)
    try:
        printed, _ = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    try:
        return wanted.model_validate_json(printed)
    except ValueError as error:
        raise HexacellError(
            "the computation ended without a result", action="Try `hexacell preflight` in another terminal"
        ) from error


def find_preflight(path: Path, mode: Mode) -> Preflight:
    """The findings of a preflight, and whether a run may begin."""
    try:
        with plugin_failures_named():
            devices = asyncio.run(preflight(load_cell(path), mode, unattended=False))
    except HexacellError as error:
        return Preflight(items=failed_items(error), is_ready=False)
    return Preflight(items=checked_items(Mark.DONE, [device_line(one) for one in devices]), is_ready=True)


def find_plan(path: Path) -> TriedPlan:
    """The forecast of the plan on simulated robots, and its poses; or why it cannot be tried."""
    try:
        with plugin_failures_named():
            trial = try_plan(load_cell(path))
    except HexacellError as error:
        return TriedPlan(lines=(str(error),))
    return TriedPlan(lines=tuple(plan_trial_lines(trial)), poses=trial.result.visited)


if __name__ == "__main__":
    named, file, mode_name = sys.argv[1:]
    if named == "plan" and hasattr(os, "nice"):
        os.nice(LEAST_URGENT)  # the screen and a run come first
    found = find_plan(Path(file)) if named == "plan" else find_preflight(Path(file), Mode(mode_name))
    sys.stdout.write(found.model_dump_json())
