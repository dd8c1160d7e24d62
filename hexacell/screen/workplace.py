"""The cell behind a screen: its file, devices, preflight, plan, runs and config."""

import asyncio
from collections.abc import AsyncIterator

from hexacell.cell.loader import Cell
from hexacell.cell.passwords import password_warnings
from hexacell.config.pending_write import settle_config
from hexacell.dry_run.campaign import VisitedPose
from hexacell.errors import UsageError
from hexacell.run_process.client import RunConnection, begin_run, connect_to_run, resume_run
from hexacell.run_process.live_devices import watch_devices
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.run_process.recorded import RecordedRun
from hexacell.run_process.run_socket import socket_path
from hexacell.runs.run_folder import find_run
from hexacell.screen.child import Preflight, TriedPlan, run_child
from hexacell.screen.preferences import RESUME, WITH_LENGTH
from hexacell.services.history.journal_soundness import read_sound
from hexacell.services.history.past_runs import compare_runs, parameter_trends, past_runs
from hexacell.services.history.run_index import PastRun
from hexacell.services.history.run_summary import is_applied_later
from hexacell.services.preflight import exposure_warnings, toggle_exclusion
from hexacell.services.write_back.config_rollback import roll_back_config
from hexacell.services.write_back.proposals import apply_proposal, approval_question, read_proposal
from hexacell.text.config_changes import applied_text, rollback_text
from hexacell.text.history import comparison_text, drift_text
from procedures.calibration.calibration import Mode
from procedures.run.questions import Question


def mode_of(what: str) -> Mode:
    """The mode of what a person starts; a run that is resumed is checked as a calibration."""
    return Mode.OPTIMISE if what in {RESUME, WITH_LENGTH} else Mode(what)


class Workplace:
    """A cell: its devices, its run and its history. All methods raise ``HexacellError``.

    Attributes:
        cell: the cell as its file states it now.
        warnings: what a person should change in it.

    Raises:
        FileError: a write of its config was interrupted, and cannot be settled.
    """

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        settled = settle_config(*self.cell.config_paths)
        self.warnings = (
            *password_warnings(self.cell),
            *exposure_warnings(self.cell),
            *([] if settled is None else [settled]),
        )

    def watch(self) -> AsyncIterator[LiveSnapshot]:
        """What the devices show while no run has them; cancelling lets them go."""
        return watch_devices(self.cell)

    async def attach(self) -> RunConnection | None:
        """The run that goes on in this cell, if one does."""
        return await connect_to_run(socket_path(self.cell))

    async def start(self, what: str) -> RunConnection:
        """Begin a run of a mode in a process of its own, or resume the latest interrupted one."""
        if what == RESUME:
            return await resume_run(self.cell)
        return await begin_run(self.cell, mode_of(what), length_check=what == WITH_LENGTH)

    async def check(self, what: str) -> Preflight:
        """Check everything that must hold before the motion of a mode; needs the devices."""
        return await run_child(Preflight, self.cell.path, mode_of(what).value)

    async def preview(self) -> TriedPlan:
        """Carry the plan out on simulated robots."""
        return await run_child(TriedPlan, self.cell.path)

    async def toggle_exclusion(self, name: str, planned: tuple[VisitedPose, ...]) -> None:
        """Write an exclusion into the cell file, or remove it."""
        self.cell = await asyncio.to_thread(toggle_exclusion, self.cell, name, planned)

    async def runs(self) -> tuple[PastRun, ...]:
        """The runs of the cell, the latest first."""
        return await asyncio.to_thread(past_runs, self.cell)

    async def compare(self, run: str) -> tuple[str, ...]:
        """A run beside the one before it."""
        identified = [one.name for one in await self.runs() if one.summary.has_result]
        earlier = identified[identified.index(run) + 1 :] if run in identified else []
        if not earlier:
            raise UsageError(f"no run before {run} identified a geometry", action="Choose a later one")
        compared = await asyncio.to_thread(compare_runs, self.cell, earlier[0], run)
        return tuple(comparison_text(*compared).splitlines())

    async def drift(self) -> tuple[str, ...]:
        """The drift of each parameter over all runs."""
        found = await asyncio.to_thread(parameter_trends, self.cell, await self.runs())
        return tuple(drift_text(found).splitlines())

    async def is_in_controller(self, run: str) -> bool:
        """Whether the controller's config is the one that a run wrote; ``UsageError`` if it wrote none."""
        one = next((one for one in await self.runs() if one.name == run), None)
        if one is None or not (one.summary.has_written or is_applied_later(one.folder)):
            raise UsageError(f"{run} has written no config", action="Choose a run that has")
        return one.is_in_controller

    async def approval(self, run: str) -> Question:
        """The question that a person is asked before the open proposal of a run is written."""
        if not any(one.name == run and one.summary.has_proposal for one in await self.runs()):
            raise UsageError(f"{run} has no proposal that could be written", action="Choose one that has")
        return approval_question(read_proposal(find_run(self.cell, run)))

    async def apply(self, run: str, by: str) -> tuple[str, ...]:
        """Write the proposal of a run, which a person has approved; the lines say what was done.

        Raises:
            ConfigEditedSince: somebody has edited the config since.
            LimitError: a gate refuses it.
        """
        proposal = await asyncio.to_thread(read_proposal, find_run(self.cell, run))
        applied = await apply_proposal(proposal, None, typed_by=by)
        return tuple(applied_text(applied).splitlines())

    async def roll_back(self, run: str, by: str) -> tuple[str, ...]:
        """Restore the config that a run wrote, or the previous one if the controller has it.

        ``by`` is who decided on it, for the history of the config. The lines say what was done.

        Raises:
            ConfigEditedSince: somebody has edited the config since.
        """
        to = None if await self.is_in_controller(run) else run
        done = await asyncio.to_thread(roll_back_config, self.cell, to, by=by)
        return tuple(rollback_text(done).splitlines())

    async def open_run(self, run: str) -> RunConnection:
        """A recorded run."""
        folder = find_run(self.cell, run)
        await asyncio.to_thread(read_sound, folder, self.cell.settings)
        return await asyncio.to_thread(RecordedRun, folder)
