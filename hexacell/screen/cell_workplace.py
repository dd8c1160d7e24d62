"""A workplace (:class:`~hexacell.screen.workplace.Workplace`) over the cell that a person named."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

from hexacell.application.interrupted_runs import LATEST, run_to_resume
from hexacell.application.security_warnings import exposure_warnings
from hexacell.attach.client import connect_to_run, start_host
from hexacell.attach.connection import RunConnection
from hexacell.attach.device_watch import watch_devices
from hexacell.attach.recorded import RecordedRun
from hexacell.attach.run_socket import socket_path
from hexacell.attach.snapshots import LiveSnapshot
from hexacell.cell.loader import Cell, load_cell
from hexacell.cell.passwords import password_warnings
from hexacell.errors import UsageError
from hexacell.presentation.screens.views import ChecklistItem, HistoryEntry, Mark
from hexacell.runs.run_folder import find_run, new_run
from hexacell.screen.child_process import run_child
from hexacell.screen.recorded_entries import recorded_entries
from hexacell.screen.workplace import Preflight


class CellWorkplace:
    """The cell at a path.

    Raises:
        FileError: its file cannot be read, or has one mistake.
        SeveralErrors: it has more than one.
    """

    def __init__(self, path: Path) -> None:
        self.cell: Cell = load_cell(path)
        self.warnings = (*password_warnings(self.cell), *exposure_warnings(self.cell))

    def watch(self) -> AsyncIterator[LiveSnapshot]:
        """See :class:`Workplace`."""
        return watch_devices(self.cell)

    async def attach(self) -> RunConnection | None:
        """See :class:`Workplace`."""
        return await connect_to_run(socket_path(self.cell))

    async def start(self) -> RunConnection:
        """See :class:`Workplace`; an interrupted calibration is resumed."""
        arguments = [str(self.cell.path), "--mode", "optimise"]
        try:
            interrupted = run_to_resume(self.cell, LATEST)
        except UsageError:
            folder, resuming = new_run(self.cell), []
        else:
            folder, resuming = interrupted, ["--resume"]
        arguments += ["--folder", str(folder.path), *resuming]
        return await start_host(socket_path(self.cell), arguments)

    async def check(self) -> Preflight:
        """See :class:`Workplace`."""
        found = await run_child("hexacell.screen.preflight_child", self.cell.path)
        items = tuple(ChecklistItem(**{**one, "mark": Mark(one["mark"])}) for one in found["items"])
        return Preflight(items, bool(found["is_ready"]))

    async def preview(self) -> tuple[str, ...]:
        """See :class:`Workplace`."""
        return tuple(await run_child("hexacell.screen.plan_child", self.cell.path))

    async def runs(self) -> tuple[HistoryEntry, ...]:
        """See :class:`Workplace`."""
        return await asyncio.to_thread(recorded_entries, self.cell)

    async def compare(self, run: str) -> tuple[str, ...]:
        """See :class:`Workplace`."""
        raise UsageError(f"{run}: runs cannot be compared yet")

    async def roll_back(self, run: str) -> str:
        """See :class:`Workplace`."""
        raise UsageError(f"{run}: nothing can be rolled back yet")

    async def open_run(self, run: str) -> RunConnection:
        """See :class:`Workplace`."""
        return await asyncio.to_thread(RecordedRun, find_run(self.cell, run))
