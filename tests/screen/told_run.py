"""A run that is told by a test: the connection and the workplace of a screen, without processes."""

import asyncio
from collections.abc import AsyncIterator, Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.cell.loader import Cell
from hexacell.dry_run.campaign import VisitedPose
from hexacell.results.run_comparison import ParameterTrend
from hexacell.run_process.client import RunConnection
from hexacell.run_process.live_snapshot import GaugeSnapshot, LiveSnapshot, Shown
from hexacell.run_process.messages import (
    ControlChanged,
    EventRecorded,
    HostMessage,
    QuestionChanged,
    RunDescribed,
    StatusChanged,
)
from hexacell.runs.run_folder import RunFolder
from hexacell.screen.child import Preflight, TriedPlan
from hexacell.screen.workplace import Workplace
from hexacell.services.history.run_index import PastRun, RunSummary
from hexacell.text.history import drift_text
from hexacell.text.screens.views import ChecklistItem, Mark
from procedures.engine.command_loop import Status
from procedures.engine.commands import Command
from procedures.run.questions import Question
from procedures.steps.events import Event

BEGUN = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)


def past_run(name: str, *, is_in_controller: bool = False, **summary: object) -> PastRun:
    """A run in the history of a cell."""
    return PastRun(RunFolder(Path(name)), RunSummary.model_validate(summary), is_in_controller)


def gauges(**changes: dict[str, object]) -> tuple[GaugeSnapshot, ...]:
    """Three gauges that show something; ``x={...}`` changes one of them."""
    shown = {"x": 0.4127, "y": -0.2089, "z": 1.1034}
    usual = {"age_s": 0.1, "noise_mm": 0.0008, "travel_mm": 12.5, "middle_mm": 0.0}
    return tuple(
        GaugeSnapshot.model_validate(
            {"name": axis, "axis": axis, "shown_mm": value} | usual | changes.get(axis, {})
        )
        for axis, value in shown.items()
    )


def snapshot(stop_reason: str = "", **changes: dict[str, object]) -> LiveSnapshot:
    """All devices, working."""
    return LiveSnapshot(
        gauges=gauges(**changes),
        encoders=Shown(
            value=EncoderSample((), (-120.4531, 14.2187, 88.0021, 301.7745, -45.1002, 210.6654)), age_s=0.1
        ),
        controller=Shown(value=ControllerStatus(estop=False, enabled=True), age_s=0.2),
        stop_reason=stop_reason,
    )


@dataclass
class ToldRun:
    """A :class:`RunConnection` that tells what a test puts into it, and keeps what it is given."""

    given: list[Command] = field(default_factory=list)
    left: list[bool] = field(default_factory=list)
    taken: int = 0
    events: int = 0
    _waiting: asyncio.Queue[HostMessage | None] = field(default_factory=asyncio.Queue)

    def tell(self, *messages: HostMessage) -> None:
        """Tell some messages."""
        for message in messages:
            self._waiting.put_nowait(message)

    def record(self, history: Iterable[Event]) -> None:
        """Tell events, two seconds apart."""
        for event in history:
            self.events += 1
            at = BEGUN + timedelta(seconds=2 * self.events)
            self.tell(EventRecorded(sequence=self.events, at=at, event=event))

    def begin(self, cell: Cell) -> None:
        """What every run tells first."""
        folder = Path("runs/simulated-hexaglide/2026-03-02T080000Z")
        self.tell(
            RunDescribed(
                cell=cell.settings.name,
                cell_file=cell.path,
                folder=folder,
                mode="optimise",
                expected_records=150,
            ),
            ControlChanged(is_in_control=True, who="ada"),
            StatusChanged(status=Status.RUNNING),
        )

    def ask(self, question: Question) -> None:
        """Open a question."""
        self.tell(QuestionChanged(question=question), StatusChanged(status=Status.AWAITING_OPERATOR))

    def close_question(self) -> None:
        """Close it."""
        self.tell(QuestionChanged(question=None), StatusChanged(status=Status.RUNNING))

    def end(self) -> None:
        """The host is gone."""
        self._waiting.put_nowait(None)

    async def messages(self) -> AsyncIterator[HostMessage]:
        while (message := await self._waiting.get()) is not None:
            yield message

    async def give(self, command: Command) -> None:
        self.given.append(command)

    async def take_control(self) -> None:
        self.taken += 1

    async def leave(self, *, keep_running: bool) -> None:
        self.left.append(keep_running)
        self.end()


@dataclass
class ToldWorkplace(Workplace):
    """A workplace without devices and processes."""

    cell: Cell
    run: RunConnection | None = None
    warnings: tuple[str, ...] = ()
    live: Sequence[LiveSnapshot] = ()
    preflight: Preflight = field(
        default_factory=lambda: Preflight(items=(ChecklistItem(Mark.DONE, "all"),), is_ready=True)
    )
    plan: TriedPlan = field(default_factory=TriedPlan)
    entries: tuple[PastRun, ...] = ()
    trends: Sequence[ParameterTrend] = ()
    started: RunConnection | None = None
    opened: RunConnection | None = None
    begun: list[str] = field(default_factory=list)
    checked: list[str] = field(default_factory=list)
    toggled: list[str] = field(default_factory=list)
    tried: int = 0
    rolled_back: list[tuple[str, str]] = field(default_factory=list)

    async def watch(self) -> AsyncIterator[LiveSnapshot]:
        for one in self.live:
            yield one
        await asyncio.get_running_loop().create_future()

    async def attach(self) -> RunConnection | None:
        return self.run

    async def start(self, what: str) -> RunConnection:
        assert self.started is not None, what
        self.begun.append(what)
        return self.started

    async def check(self, what: str) -> Preflight:
        self.checked.append(what)
        return self.preflight

    async def preview(self) -> TriedPlan:
        self.tried += 1
        return self.plan

    async def toggle_exclusion(self, name: str, planned: tuple[VisitedPose, ...]) -> None:
        self.toggled.append(name)

    async def runs(self) -> tuple[PastRun, ...]:
        return self.entries

    async def compare(self, run: str) -> tuple[str, ...]:
        return (run,)

    async def drift(self) -> tuple[str, ...]:
        return tuple(drift_text(self.trends).splitlines())

    async def is_in_controller(self, run: str) -> bool:
        return run == self.entries[0].name

    async def approval(self, run: str) -> Question:
        raise NotImplementedError

    async def apply(self, run: str, by: str) -> tuple[str, ...]:
        raise NotImplementedError

    async def roll_back(self, run: str, by: str) -> tuple[str, ...]:
        self.rolled_back.append((run, by))
        return (f"the config of before {run} is back",)

    async def open_run(self, run: str) -> RunConnection:
        assert self.opened is not None, run
        return self.opened
