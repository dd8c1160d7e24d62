"""What a session needs of a real cell; tests have one of their own."""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Protocol

from hexacell.cell.loader import Cell
from hexacell.dry_run.campaign import VisitedPose
from hexacell.run_process.connection import RunConnection
from hexacell.run_process.snapshots import LiveSnapshot
from hexacell.text.screens.views import ChecklistItem, HistoryEntry
from procedures.run.questions import Question


@dataclass(frozen=True, slots=True)
class Preflight:
    """What a preflight found, and whether a run may begin."""

    items: tuple[ChecklistItem, ...]
    is_ready: bool


@dataclass(frozen=True, slots=True)
class TriedPlan:
    """What a plan gives in lines of text, and its poses; empty where it could not be tried."""

    lines: tuple[str, ...] = ()
    poses: tuple[VisitedPose, ...] = ()


class Workplace(Protocol):
    """A cell, its devices, its run and its history. All raise ``HexacellError``."""

    @property
    def cell(self) -> Cell:
        """Its file."""
        ...

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should change in it."""
        ...

    def watch(self) -> AsyncIterator[LiveSnapshot]:
        """What the devices show while no run has them; cancelling lets them go."""
        ...

    async def attach(self) -> RunConnection | None:
        """The run that goes on in this cell, if one does."""
        ...

    async def start(self, what: str) -> RunConnection:
        """Begin a run in a process of its own: the name of a mode; or resume the latest interrupted one."""
        ...

    async def check(self, what: str) -> Preflight:
        """Look at everything that must hold before the motion of a mode; needs the devices."""
        ...

    async def preview(self) -> TriedPlan:
        """Carry the plan out on simulated robots."""
        ...

    async def toggle_exclusion(self, name: str, planned: tuple[VisitedPose, ...]) -> None:
        """Write an exclusion into the cell file, or remove it."""
        ...

    async def runs(self) -> tuple[HistoryEntry, ...]:
        """The runs of the cell, the latest first."""
        ...

    async def compare(self, run: str) -> tuple[str, ...]:
        """A run beside the one before it."""
        ...

    async def drift(self) -> tuple[str, ...]:
        """The drift of each parameter over all runs."""
        ...

    async def is_in_controller(self, run: str) -> bool:
        """Whether the controller's config is the one that a run wrote."""
        ...

    async def approval(self, run: str) -> Question:
        """What a person is asked before the open proposal of a run is written.

        Raises:
            UsageError: it has none.
        """
        ...

    async def apply(self, run: str, by: str) -> tuple[str, ...]:
        """Write the proposal of a run, which a person has approved; what was done.

        Raises:
            ConfigEditedSince: somebody has edited the config since.
            LimitError: a gate refuses it.
        """
        ...

    async def roll_back(self, run: str, by: str) -> tuple[str, ...]:
        """Put back the config that a run wrote, or of before it if the controller has it; what was done.

        ``by`` is who decided on it, as the history of the config is to have it.

        Raises:
            ConfigEditedSince: somebody has edited the config since.
        """
        ...

    async def open_run(self, run: str) -> RunConnection:
        """A recorded run."""
        ...
