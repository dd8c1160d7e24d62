"""The model behind the screens: a cell, the run in it, and what a person may ask for."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from operator import is_
from typing import Any

from hexacell.cell.loader import describe
from hexacell.config.versions import ConfigEditedSince
from hexacell.errors import HexacellError, UsageError
from hexacell.run_process.messages import LiveSnapshot
from hexacell.run_process.recorded import RecordedRun
from hexacell.screen.child import TriedPlan
from hexacell.screen.preferences import ONCE, RESUME, WITH_LENGTH, ScreenAction
from hexacell.screen.watching import DeviceWatcher, RunFollower
from hexacell.screen.workplace import Workplace
from hexacell.services.history.run_index import PastRun
from hexacell.services.robot_view import first_scene
from hexacell.text.config_changes import RELOAD, versions_text
from hexacell.text.screens import banner, devices, past_runs, reviewing
from hexacell.text.screens.cell_facts import cell_facts
from hexacell.text.screens.checklist import (
    checked_items,
    live_items,
    plan_lines,
    plan_note,
    plan_rows,
    summary,
)
from hexacell.text.screens.measuring import accuracy_plot, fault_view, progress, record_rows
from hexacell.text.screens.placing import WIDE_BAR, Placing, placing
from hexacell.text.screens.questions import ABORTING, PERSON, question_view
from hexacell.text.screens.run_picture import header_line, refusal_text
from hexacell.text.screens.views import Banner, ChecklistItem, FaultView, Line, Mark, QuestionView, Urgency
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
        changed: set whenever there may be something else to show.
        runs: the runs of the cell, the latest first; None until they are read.
    """

    def __init__(self, workplace: Workplace, now: Callable[[], float] = time.monotonic) -> None:
        self._workplace, self._now = workplace, now
        self.changed = asyncio.Event()
        self.run = RunFollower(now, self._after_run, self.changed.set)
        self._devices = DeviceWatcher(workplace.watch, now, self.changed.set)
        self._run_is_over = asyncio.Event()
        self._is_checking, self._is_starting, self._is_ready = False, False, False
        self._is_unfolded = False
        self._scene = first_scene(workplace.cell)
        self._checked: tuple[ChecklistItem, ...] | None = None
        self.runs: tuple[PastRun, ...] | None = None
        self._compared: tuple[str, ...] = ()
        self._tried: TriedPlan | None = None
        self._trial: asyncio.Future[TriedPlan] | None = None
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

    def header(self) -> tuple[str, str]:
        """The first line of every screen: what is done where, and who is in control."""
        return header_line(self._workplace.cell.settings.name, self.run.picture)

    def banner(self, screen: str) -> Banner:
        """The banner of a screen: that of the run while one goes on, else what this screen is for."""
        if self._is_starting:
            return banner.STARTING
        is_of_run = self._is_running or screen in {"measure", "review"}
        if is_of_run and screen != "preflight":
            return banner.run_banner(self.run.picture, self._workplace.cell.settings)
        match screen:
            case "cell":
                return banner.cell_banner(self._devices.live, self._devices.problem)
            case "preflight":
                return banner.preflight_banner(
                    self._checked, is_checking=self._is_checking, is_running=self._is_running
                )
            case _:
                return banner.history_banner(None if self.runs is None else len(self.runs))

    def shown(self, screen: str) -> dict[str, tuple[Any, ...]]:
        """What the parts of a screen show now, by their names: what each ``show`` is called with."""
        cell, picture = self._workplace.cell, self.run.picture
        tried, is_trying = self._tried or TriedPlan(), self._trial is not None
        match screen:
            case "cell":
                warnings = [(one, Urgency.ATTENTION) for one in self._workplace.warnings]
                facts = ([*warnings, *((one, Urgency.CALM) for one in cell_facts(cell))],)
                cards = (devices.device_cards(*self._live()),)
                return {"cards": cards, "facts": facts, "robot": (self._scene,)}
            case "preflight":
                if (checked := self._checked) is None:
                    checked = checked_items(Mark.BUSY if self._is_checking else Mark.OPEN)
                items = (*live_items(self._live()[0], is_checking=self._is_checking), *checked)
                lines = [(summary(items), Urgency.CALM)]
                lines += [line for item in items for line in item.lines(is_unfolded=self._is_unfolded)]
                return {
                    "checklist": (lines,),
                    "plan": (plan_lines(cell.settings, tried.lines, is_trying=is_trying),),
                }
            case "plan":
                note = plan_note(tried.poses, is_trying=is_trying)
                return {"plan-note": (note,), "poses": ([*plan_rows(cell.settings, tried.poses)],)}
            case "measure":
                limit = cell.settings.identification.target_mm or cell.settings.acceptance.position_mm
                return {
                    "progress": (progress(picture, cell.settings),),
                    "gauges": (self.gauges(),),
                    "records": (record_rows(picture),),
                    "accuracy": (accuracy_plot(picture, limit),),
                }
            case "review":
                return self._result()
            case _:  # the history
                return {
                    "runs": (past_runs.run_rows(self.runs or ()),),
                    "trend": (past_runs.trend_plot(self.runs or ()),),
                    "comparison": (self._compared or past_runs.NOTHING_ASKED,),
                }

    @property
    def described(self) -> tuple[str, tuple[str, ...]]:
        """The whole cell file: what it is, and its lines."""
        cell = self._workplace.cell
        title = f"{cell.path.name}: behind each value its line in the file, or default"
        return title, tuple(describe(cell).splitlines())

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

    def gauges(self) -> list[Line]:
        """A line for each gauge, and one for the other devices."""
        return devices.gauge_lines(*self._measured())

    def placing(self) -> Placing:
        """How the gauges stand while they are placed."""
        return placing(self._measured()[0], self._workplace.cell.settings.stations.mounting_mm)

    def figures(self) -> tuple[list[tuple[str, str, str, Urgency]], int]:
        """Axis, figure, bar and urgency of each gauge, and the number of records."""
        snapshot, _, zero = self._measured()
        shown: list[tuple[str, str, str, Urgency]] = [
            (
                one.axis,
                devices.gauge_figure(one, zero),
                devices.travel_bar(devices.plunger_place(one), one.travel_mm / 2.0, WIDE_BAR),
                devices.urgency_of(one.problem),
            )
            for one in (() if snapshot is None else snapshot.gauges)
        ]
        return shown, sum(len(measured.samples) for measured in self.run.picture.state.sets.values())

    def _result(self) -> dict[str, tuple[Any, ...]]:
        """The parts of the result; made again where something has changed beside the live values."""
        picture, may_write = self.run.picture, bool(self.proposing_run)
        seen = (picture.state, picture.question, may_write)
        if self._reviewed is None or not all(map(is_, self._reviewed[0], seen)):
            settings, state = self._workplace.cell.settings, picture.state
            verdict, consequences, scope = reviewing.review_lines(picture, may_write=may_write)
            shown: dict[str, tuple[Any, ...]] = {
                "verdict": verdict,
                "consequences": (consequences,),
                "scope": (scope,),
                "frames": (reviewing.frames_note(state),),
                "parameters": (reviewing.parameter_cells(state, settings),),
                "change": (reviewing.change_text(picture),),
                "plot-deviation": (reviewing.deviation_plot(state),),
                "plot-residual": (reviewing.residual_plot(picture),),
                "plot-accuracy": (accuracy_plot(picture, settings.acceptance.position_mm),),
            }
            self._reviewed = (seen, shown)
        return self._reviewed[1]

    def question(self) -> QuestionView | None:
        """The question that waits, if one does and may be answered here."""
        picture = self.run.picture
        if picture.question is None or not picture.may_command:
            return None
        return question_view(picture.question, picture.live)

    def fault(self) -> FaultView | None:
        """The latest fault; those of a recorded run are long past, and what was declined is none."""
        picture = self.run.picture
        if picture.setback is None or picture.is_recorded or picture.why_not_written:
            return None
        return fault_view(picture.setback)

    # Actions.

    @property
    def refusal(self) -> tuple[int, str]:
        """How many commands of the run were refused, and why the last one was."""
        picture = self.run.picture
        return picture.refusals, "" if picture.refusal is None else refusal_text(picture.refusal)

    def allows(self, action: ScreenAction, argument: str = "") -> bool:
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
            case asked.START if not self._may_start(argument):
                return False
            case asked.CHECK | asked.START | asked.EXCLUDE | asked.ROLL_BACK | asked.APPLY:
                return not (self._is_running or self._is_checking or self._is_starting)
            case _:
                return True

    def _may_start(self, what: str) -> bool:
        """Whether there is what a run needs: a fixture for its length check, or a run to resume."""
        if what in {Mode.LENGTH, WITH_LENGTH}:
            return self._workplace.cell.settings.length_check is not None
        if what == RESUME:
            return any(one.summary.has_begun and not one.summary.is_over for one in self.runs or ())
        return True

    async def perform(  # noqa: C901, PLR0912 - a case an action
        self, action: ScreenAction, argument: str = ""
    ) -> str:
        """Do what was asked for; a remark about it, or an empty text."""
        if not self.allows(action, argument):
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
            case ScreenAction.UNFOLD:
                self._is_unfolded = not self._is_unfolded
            case ScreenAction.STEP | ScreenAction.PLAY if (recording := self._recording) is not None:
                self._wind(recording, action, argument)
        return ""

    async def confirmation(self, action: ScreenAction, argument: str) -> QuestionView | None:
        """What a person must consent to before an action; None if to nothing."""
        match action:
            case ScreenAction.APPLY:
                return question_view(await self._workplace.approval(argument), None)
            case ScreenAction.ABORT:
                return ABORTING
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
                done = await change(run, PERSON)
                # Below a long change nobody would see it.
                self._compared = (RELOAD, "", *done) if RELOAD in " ".join(done) else done
        except ConfigEditedSince as edited:
            self._compared = tuple(versions_text(edited.versions).splitlines())
            raise
        await self._read_history()
        return RELOAD if RELOAD in self._compared else self._compared[-1]

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
