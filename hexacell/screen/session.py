"""The world behind the screens: a cell, the run in it, and what was asked for."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import replace

from hexacell.cell.loader import Cell, describe
from hexacell.screen.backend import ScreenAction
from hexacell.screen.device_watcher import DeviceWatcher
from hexacell.screen.run_follower import RunFollower
from hexacell.screen.session_actions import SessionActions
from hexacell.screen.workplace import Workplace
from hexacell.text.screens.headers import header_view
from hexacell.text.screens.live import RUNNING, STARTING, checklist_view, live_view
from hexacell.text.screens.measuring import fault_view, measure_view
from hexacell.text.screens.planned_poses import plan_view
from hexacell.text.screens.questions import question_view
from hexacell.text.screens.reviewing import PROPOSAL_WAITS, history_view, review_view, rollback_question
from hexacell.text.screens.views import (
    CellView,
    ChecklistView,
    FaultView,
    HeaderView,
    HistoryView,
    LiveView,
    MeasureView,
    PlanView,
    QuestionView,
    ReviewView,
)
from procedures.engine.commands import Answer


class ScreenSession:
    """A backend (:class:`~hexacell.screen.backend.Backend`) over one workplace; ``now`` gives seconds."""

    def __init__(self, workplace: Workplace, now: Callable[[], float] = time.monotonic) -> None:
        self._workplace, self._now = workplace, now
        self._run = RunFollower(now, self._after_run)
        self._devices = DeviceWatcher(workplace.watch, now)
        self._actions = SessionActions(workplace, self._run, self._devices)
        self._run_is_over = asyncio.Event()
        self._reviewed: tuple[object, ReviewView] | None = None
        self._described: tuple[Cell | None, tuple[str, ...]] = (None, ())

    @property
    def question_number(self) -> int:
        """See :class:`~hexacell.screen.backend.Backend`."""
        return self._run.questions

    @property
    def fault_number(self) -> int:
        """See :class:`~hexacell.screen.backend.Backend`."""
        return 1000 * self._run.runs + self._run.picture.setbacks

    @property
    def runs_followed(self) -> int:
        """See :class:`~hexacell.screen.backend.Backend`."""
        return self._run.runs

    @property
    def may_leave_run(self) -> bool:
        """See :class:`~hexacell.screen.backend.Backend`."""
        return self._actions.is_running and self._run.picture.may_command

    @property
    def proposing_run(self) -> str:
        """See :class:`~hexacell.screen.backend.Backend`."""
        described = self._run.picture.described
        if described is None or not described.is_recorded:
            return ""
        entries = self._actions.findings.entries or ()
        name = described.folder.name
        return name if any(one.name == name and one.has_proposal for one in entries) else ""

    def header(self) -> HeaderView:
        """The first line of every screen."""
        return header_view(self._workplace.cell.settings.name, self._run.picture)

    def cell(self) -> CellView:
        """The cell and its devices."""
        cell = self._workplace.cell
        live = self._live()
        if self._devices.problem and not live.gauges:
            live = LiveView(note=self._devices.problem)
        title = f"What {cell.path.name} says; behind each value its line in the file, or default"
        if self._described[0] is not cell:
            self._described = (cell, tuple(describe(cell).splitlines()))
        return CellView(title, live, self._described[1], self._workplace.warnings)

    def _live(self) -> LiveView:
        if self._actions.is_running:
            return live_view(self._run.picture.live, self._now() - self._run.picture.live_at_s)
        return live_view(self._devices.live, self._now() - self._devices.live_at_s)

    def checklist(self) -> ChecklistView:
        """What must hold before motion."""
        found, is_running = self._actions.findings, self._actions.is_running
        return checklist_view(
            self._run.picture.live if is_running else self._devices.live,
            found.checked,
            self._actions.plan.lines,
            is_checking=found.is_checking,
            refusal=RUNNING if is_running else STARTING if found.is_starting else "",
            has_fixture=self._workplace.cell.settings.length_check is not None,
        )

    def plan(self) -> PlanView:
        """The poses of the plan, and what the cell file excludes."""
        plan = self._actions.plan
        poses = () if plan.tried is None else plan.tried.poses
        return plan_view(self._workplace.cell.settings, poses, is_trying=plan.is_trying)

    def measure(self) -> MeasureView:
        """The run that is being measured; its devices are shown even where none has begun."""
        view = measure_view(self._run.picture, self._workplace.cell.settings, self._now())
        is_shown_live = self._run.connection is not None or self._devices.live is None
        return view if is_shown_live else replace(view, live=self._live())

    def review(self) -> ReviewView:
        """The result; made again where something has changed beside the live values."""
        picture = self._run.picture
        if self._reviewed is None or self._reviewed[0] != (id(picture.state), id(picture.question)):
            view = review_view(picture, self._workplace.cell.settings)
            self._reviewed = ((id(picture.state), id(picture.question)), view)
        shown = self._reviewed[1]
        if not self.proposing_run:
            return shown
        return replace(shown, approval=f"{shown.approval} {PROPOSAL_WAITS}")

    def history(self) -> HistoryView:
        """The runs of the cell."""
        return history_view(self._actions.findings.entries, self._actions.findings.compared)

    def question(self) -> QuestionView | None:
        """The question that waits, if one does and may be answered here."""
        picture = self._run.picture
        if picture.question is None or not picture.may_command:
            return None
        return question_view(picture.question, picture.live)

    def fault(self) -> FaultView | None:
        """The latest fault; those of a recorded run are long past."""
        picture = self._run.picture
        return None if picture.setback is None or picture.is_recorded else fault_view(picture.setback)

    def allows(self, action: ScreenAction) -> bool:
        """Whether an action has an effect now."""
        return self._actions.allows(action)

    async def perform(self, action: ScreenAction, argument: str = "") -> str:
        """Do what was asked for; what there is to say about it. Raises ``HexacellError``."""
        return await self._actions.perform(action, argument)

    async def confirmation(self, action: ScreenAction, argument: str) -> QuestionView | None:
        """What a person must consent to before an action; none if to nothing. Raises ``HexacellError``."""
        match action:
            case ScreenAction.APPLY:
                return question_view(await self._workplace.approval(argument), None)
            case ScreenAction.ROLL_BACK:
                is_there = await self._workplace.is_in_controller(argument)
                return rollback_question(argument, is_in_controller=is_there)
            case _:
                return None

    async def answer(self, value: str | None) -> None:
        """Answer the question. Raises ``HexacellError``."""
        await self._run.give(Answer(value))

    async def attend(self) -> None:
        """Follow the cell and its run until cancelled. Raises ``HexacellError``."""
        try:
            running = await self._workplace.attach()
            if running is None:
                self._devices.start()
            else:
                await self._run.follow(running)
            while True:
                await self._actions.read_history()
                await self._run_is_over.wait()
                self._run_is_over.clear()
        finally:
            await self._run.stop()
            await self._devices.stop()

    async def leave(self, *, keep_running: bool) -> None:
        """Let the run go on alone, or have it stopped. Raises ``HexacellError``."""
        if self._actions.is_running:
            await self._run.leave(keep_running=keep_running)

    def _after_run(self) -> None:
        """The devices are free, and there is one more run in the history."""
        self._devices.start()
        self._run_is_over.set()
