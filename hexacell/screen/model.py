"""The model behind the screens: a cell, the run in it, and what a person may ask for."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from operator import is_
from typing import Any

from hexacell.cell.loader import Cell, describe
from hexacell.config.versions import ConfigEditedSince
from hexacell.errors import HexacellError, UsageError
from hexacell.run_process.messages import LiveSnapshot
from hexacell.run_process.recorded import RecordedRun
from hexacell.screen.child import TriedPlan
from hexacell.screen.preferences import ONCE, ScreenAction
from hexacell.screen.watching import DeviceWatcher, RunFollower
from hexacell.screen.workplace import Workplace
from hexacell.services.history.run_index import PastRun
from hexacell.text.config_changes import RELOAD, versions_text
from hexacell.text.history import NO_RUNS, history_head, history_line
from hexacell.text.screens import live, reviewing
from hexacell.text.screens.live import plan_lines, plan_note, plan_rows
from hexacell.text.screens.measuring import accuracy_plot, fault_view, guidance, record_lines
from hexacell.text.screens.questions import PERSON, question_view
from hexacell.text.screens.run_picture import header_line
from hexacell.text.screens.views import ChecklistItem, FaultView, Line, Mark, QuestionView, Urgency
from procedures.calibration.calibration import Mode
from procedures.engine.command_loop import Status
from procedures.engine.commands import Abort, Answer, MeasureAgain, Pause, Resume, Undo
from procedures.run.keys import ThreeNumbers

SPEEDS = (0.0, 1.0, 10.0, 60.0, 600.0)
"""Speeds of a recorded run, as multiples of that at which it was recorded; the first is standstill."""


class ScreenModel:
    """Views to be shown, and actions that may be asked for; ``now`` gives seconds.

    The views are those of this moment and cost a few milliseconds at most; what takes longer is awaited.
    Everything that is awaited raises ``HexacellError``.

    Attributes:
        run: the run that is followed, live or recorded.
        runs: the runs of the cell, the latest first; None until they are read.
    """

    def __init__(self, workplace: Workplace, now: Callable[[], float] = time.monotonic) -> None:
        self._workplace, self._now = workplace, now
        self.run = RunFollower(now, self._after_run)
        self._devices = DeviceWatcher(workplace.watch, now)
        self._run_is_over = asyncio.Event()
        self._is_checking, self._is_starting, self._is_ready = False, False, False
        self._checked: tuple[ChecklistItem, ...] | None = None
        self.runs: tuple[PastRun, ...] | None = None
        self._compared: tuple[str, ...] = ()
        self._tried: TriedPlan | None = None
        self._trial: asyncio.Future[TriedPlan] | None = None
        self._described: tuple[Cell | None, tuple[str, ...]] = (None, ())
        self._reviewed: tuple[tuple[object, ...], dict[str, tuple[Any, ...]]] | None = None

    async def attend(self) -> None:
        """Follow the cell and its run until cancelled."""
        try:
            running = await self._workplace.attach()
            if running is None:
                self._devices.start()
            else:
                await self.run.follow(running)
            while True:
                await self._read_history()
                await self._run_is_over.wait()
                self._run_is_over.clear()
        finally:
            await self.run.stop()
            await self._devices.stop()

    def _after_run(self) -> None:
        """The devices are free, and there is one more run in the history."""
        self._devices.start()
        self._run_is_over.set()

    # Views.

    @property
    def fault_number(self) -> int:
        """A number that changes with every fault."""
        return 1000 * self.run.runs + self.run.picture.setbacks

    @property
    def may_leave_run(self) -> bool:
        """Whether a run goes on that can be stopped or left."""
        return self._is_running and self.run.picture.may_command

    @property
    def proposing_run(self) -> str:
        """The recorded run in front, if its proposal can be applied; else empty."""
        described = self.run.picture.described
        if described is None or not described.is_recorded:
            return ""
        name = described.folder.name
        proposing = (one.name for one in self.runs or () if one.summary.has_proposal)
        return name if name in proposing else ""

    @property
    def _recording(self) -> RecordedRun | None:
        """The recorded run that is shown; None if a run goes on, or nothing is shown."""
        connection = self.run.connection
        return connection if isinstance(connection, RecordedRun) else None

    @property
    def _is_running(self) -> bool:
        """Whether a run goes on that has the devices."""
        return self.run.connection is not None and self._recording is None

    def header(self) -> tuple[str, str, Urgency]:
        """The first line of every screen."""
        return header_line(self._workplace.cell.settings.name, self.run.picture)

    def shown(self, screen: str) -> dict[str, tuple[Any, ...]]:
        """What the parts of a screen show now, by their names: what each ``show`` is called with."""
        cell, picture = self._workplace.cell, self.run.picture
        tried, is_trying = self._tried or TriedPlan(), self._trial is not None
        match screen:
            case "cell":
                if self._described[0] is not cell:
                    self._described = (cell, tuple(describe(cell).splitlines()))
                title = f"What {cell.path.name} says; behind each value its line in the file, or default"
                settings = (*self._workplace.warnings, *self._described[1])
                return {
                    "devices": (self._devices_now(),),
                    "settings-title": (title,),
                    "settings": (settings,),
                }
            case "preflight":
                if (checked := self._checked) is None:
                    checked = live.checked_items(Mark.BUSY if self._is_checking else Mark.OPEN)
                items = (*live.live_items(self._live()[0]), *checked)
                return {
                    "instruction": (self._instruction(),),
                    "checklist": ([line for item in items for line in item.lines],),
                    "plan": (plan_lines(cell.settings, tried.lines, is_trying=is_trying),),
                }
            case "plan":
                note = plan_note(tried.poses, is_trying=is_trying)
                return {"plan-note": (note,), "poses": ([*plan_rows(cell.settings, tried.poses)],)}
            case "measure":
                return {
                    "guidance": (guidance(picture, cell.settings),),
                    "devices": (live.device_lines(*self._measured()),),
                    "records": (record_lines(picture),),
                    "accuracy": (accuracy_plot(picture, cell.settings.identification.target_mm),),
                }
            case "review":
                return self._result()
            case _:  # the history
                title = history_head() if self.runs else reviewing.READING if self.runs is None else NO_RUNS
                asked = () if self.runs is None else (*reviewing.WHAT_TO_PRESS, "", *self._compared)
                rows = [(run.name, history_line(run)) for run in self.runs or ()]
                return {"history-header": (title,), "comparison": (asked,), "runs": (rows,)}

    def _devices_now(self) -> list[Line]:
        snapshot, later_s = self._live()
        if self._devices.problem and snapshot is None:
            return [(self._devices.problem, Urgency.CALM)]
        return live.device_lines(snapshot, later_s)

    def _live(self) -> tuple[LiveSnapshot | None, float]:
        """What the devices showed last, and how long ago, s."""
        picture, watched = self.run.picture, self._devices
        if self._is_running:
            return picture.live, self._now() - picture.live_at_s
        return watched.live, self._now() - watched.live_at_s

    def _measured(self) -> tuple[LiveSnapshot | None, float, ThreeNumbers | None]:
        """What the devices of the run showed last, how long ago, s, and the zero of its set.

        Where no run has begun, these are the devices of the cell.
        """
        picture = self.run.picture
        if self.run.connection is None and self._devices.live is not None:
            return (*self._live(), None)
        zero = None if picture.at is None else picture.state.zero_shown(picture.at)
        return picture.live, self._now() - picture.live_at_s, zero

    def _instruction(self) -> str:
        """What to press before a run, or why none can be started now."""
        if self._is_checking:
            return live.CHECKING
        if self._is_running or self._is_starting:
            return live.RUNNING if self._is_running else live.STARTING
        has_fixture = self._workplace.cell.settings.length_check is not None
        return f"{live.PRESS_CHECK} {live.PRESS_LENGTH}" if has_fixture else live.PRESS_CHECK

    def mounting(self) -> list[Line]:
        """How each gauge is to be moved while the gauges are placed."""
        return live.device_lines(*self._measured(), self._workplace.cell.settings.stations.mounting_mm)

    def figures(self) -> tuple[str, list[Line], int]:
        """What happens now, the figure of each gauge, and the number of records."""
        snapshot, _, zero = self._measured()
        gauges = () if snapshot is None else snapshot.gauges
        figures = [(live.gauge_figure(one, zero), live.urgency_of(one.problem)) for one in gauges]
        records = sum(len(measured.samples) for measured in self.run.picture.state.sets.values())
        return guidance(self.run.picture, self._workplace.cell.settings)["Now"], figures, records

    def _result(self) -> dict[str, tuple[Any, ...]]:
        """The parts of the result; made again where something has changed beside the live values."""
        picture, may_write = self.run.picture, bool(self.proposing_run)
        seen = (picture.state, picture.question, may_write)
        if self._reviewed is None or not all(map(is_, self._reviewed[0], seen)):
            texts = reviewing.review_texts(picture, self._workplace.cell.settings, may_write=may_write)
            shown: dict[str, tuple[Any, ...]] = {name: (text,) for name, text in texts.items()}
            urgency = reviewing.URGENCIES.get(picture.state.verdict, Urgency.ATTENTION)
            shown["verdict"] = (texts["verdict"], urgency)
            shown["plot-0"] = (reviewing.deviation_plot(picture.state),)
            shown["plot-1"] = (reviewing.residual_plot(picture),)
            shown["plot-2"] = (accuracy_plot(picture, None),)
            self._reviewed = (seen, shown)
        return self._reviewed[1]

    def question(self) -> QuestionView | None:
        """The question that waits, if one does and may be answered here."""
        picture = self.run.picture
        if picture.question is None or not picture.may_command:
            return None
        return question_view(picture.question, picture.live)

    def fault(self) -> FaultView | None:
        """The latest fault; those of a recorded run are long past."""
        picture = self.run.picture
        return None if picture.setback is None or picture.is_recorded else fault_view(picture.setback)

    # Actions.

    def allows(self, action: ScreenAction) -> bool:
        """Whether an action has an effect now."""
        asked = ScreenAction
        match action:
            case asked.PAUSE | asked.PAUSE_AT_ONCE | asked.UNDO | asked.MEASURE_AGAIN | asked.ABORT:
                is_over = self.run.picture.status is Status.ENDED
                return self._is_running and self.run.picture.may_command and not is_over
            case asked.STEP | asked.PLAY:
                return self._recording is not None
            case asked.TAKE_CONTROL:
                return self._is_running and not self.run.picture.may_command
            case asked.CHECK | asked.START | asked.EXCLUDE | asked.ROLL_BACK | asked.APPLY:
                return not (self._is_running or self._is_checking or self._is_starting)
            case _:
                return True

    async def perform(  # noqa: C901, PLR0912 - a case an action
        self, action: ScreenAction, argument: str = ""
    ) -> str:
        """Do what was asked for; a remark about it, or an empty text."""
        if not self.allows(action):
            raise UsageError(f"{action} has no effect now")
        workplace, connection, at = self._workplace, self.run.connection, self.run.picture.at
        match action:
            case ScreenAction.PAUSE:
                is_paused = self.run.picture.status in {Status.PAUSED, Status.PAUSING}
                await self.run.give(Resume() if is_paused else Pause())
            case ScreenAction.PAUSE_AT_ONCE:
                await self.run.give(Pause(at_once=True))
            case ScreenAction.UNDO:
                await self.run.give(Undo())
            case ScreenAction.MEASURE_AGAIN if at is not None:
                await self.run.give(MeasureAgain(at))
            case ScreenAction.MEASURE_AGAIN:
                raise UsageError("no point is being measured now")
            case ScreenAction.ABORT:
                await self.run.give(Abort())
            case ScreenAction.TAKE_CONTROL if connection is not None:
                await connection.take_control()
            case ScreenAction.CHECK:
                await self._check(argument)
            case ScreenAction.START:
                await self._start(argument)
            case ScreenAction.PREVIEW:
                await self._preview(argument)
            case ScreenAction.EXCLUDE:
                await workplace.toggle_exclusion(argument, self._tried.poses if self._tried else ())
                await self._preview("")
            case ScreenAction.COMPARE:
                self._compared = await workplace.compare(argument)
            case ScreenAction.DRIFT:
                self._compared = await workplace.drift()
            case ScreenAction.ROLL_BACK:
                return await self._change_config(workplace.roll_back, argument)
            case ScreenAction.APPLY:
                return await self._change_config(workplace.apply, argument)
            case ScreenAction.OPEN:
                await self.run.follow(await workplace.open_run(argument))
            case ScreenAction.STEP | ScreenAction.PLAY if (recording := self._recording) is not None:
                self._wind(recording, action, argument)
        return ""

    async def confirmation(self, action: ScreenAction, argument: str) -> QuestionView | None:
        """What a person must consent to before an action; None if to nothing."""
        match action:
            case ScreenAction.APPLY:
                return question_view(await self._workplace.approval(argument), None)
            case ScreenAction.ROLL_BACK:
                is_there = await self._workplace.is_in_controller(argument)
                return reviewing.rollback_question(argument, is_in_controller=is_there)
            case _:
                return None

    async def answer(self, value: str | None) -> None:
        """Answer the question."""
        await self.run.give(Answer(value))

    async def leave(self, *, keep_running: bool) -> None:
        """Let the run go on alone, or have it stopped."""
        if self._is_running:
            await self.run.leave(keep_running=keep_running)

    async def _check(self, what: str) -> None:
        self._checked, self._is_ready, self._is_checking = None, False, True
        try:
            async with self._devices.released():
                preflight = await self._workplace.check(what or Mode.OPTIMISE)
            self._checked, self._is_ready = preflight.items, preflight.is_ready
        finally:
            self._is_checking = False

    async def _start(self, what: str) -> None:
        """Checked again, as anything may have changed since somebody looked."""
        await self._check(what)
        if not self._is_ready:
            raise UsageError("not everything holds that must hold", action="Look at 2 Preflight")
        await self._devices.stop()
        self._is_starting = True
        try:
            await self.run.follow(await self._workplace.start(what))
        except BaseException:
            self._devices.start()
            raise
        finally:
            self._is_starting = False

    async def _preview(self, how_often: str) -> None:
        """Try the plan; an earlier trial is given up."""
        if how_often == ONCE and (self._trial is not None or self._tried is not None):
            return
        if self._trial is not None:
            self._trial.cancel()
        trial = self._trial = asyncio.ensure_future(self._workplace.preview())
        try:
            await asyncio.wait([trial])
            if trial is self._trial:
                self._trial = None
                self._tried = trial.result()
        finally:
            trial.cancel()

    async def _change_config(
        self, change: Callable[[str, str], Awaitable[tuple[str, ...]]], run: str
    ) -> str:
        """Where somebody has edited the config since, the three versions are shown."""
        try:
            async with self._devices.released():
                self._compared = await change(run, PERSON)
        except ConfigEditedSince as edited:
            self._compared = tuple(versions_text(edited.versions).splitlines())
            raise
        await self._read_history()
        return RELOAD if RELOAD in " ".join(self._compared) else self._compared[-1]

    async def _read_history(self) -> None:
        """Read which runs there are; where that fails, the history says why."""
        try:
            self.runs = await self._workplace.runs()
        except HexacellError as error:
            self.runs, self._compared = (), tuple(str(error).splitlines())

    def _wind(self, recording: RecordedRun, action: ScreenAction, argument: str) -> None:
        """Step to an end or by a number of events; play or halt, ``+`` faster, ``-`` slower."""
        if action is ScreenAction.PLAY:
            cursor = self.run.picture.cursor
            speed = 0.0 if cursor is None else cursor.speed
            place = SPEEDS.index(speed) if speed in SPEEDS else 0
            wanted = {"+": place + 1, "-": place - 1}.get(argument, 0 if place else 1)
            recording.set_speed(SPEEDS[min(max(wanted, 0), len(SPEEDS) - 1)])
        elif (end := {"first": 1, "last": recording.last}.get(argument)) is not None:
            recording.jump(end)
        else:
            recording.step(int(argument or 1))
