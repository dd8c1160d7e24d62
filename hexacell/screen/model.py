"""The model behind the screens: a cell, the run in it, and what a person may ask for."""

import asyncio
import time
from collections.abc import Callable
from operator import is_
from typing import TYPE_CHECKING, Any

from hexacell.cell.loader import describe
from hexacell.errors import UsageError
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.run_process.recorded import RecordedRun
from hexacell.screen.device_watcher import DeviceWatcher
from hexacell.screen.preferences import RESUME, WITH_LENGTH, ScreenAction
from hexacell.screen.readiness import Readiness
from hexacell.screen.run_follower import RunFollower
from hexacell.screen.run_history import RunHistory
from hexacell.screen.shown_devices import ShownDevices
from hexacell.screen.workplace import Workplace
from hexacell.services.history.run_index import PastRun
from hexacell.text.screens import banner, reviewing
from hexacell.text.screens.devices import cell_facts, device_cards
from hexacell.text.screens.measuring import (
    accuracy_plot,
    fault_view,
    progress,
    record_rows,
    records_by_name,
)
from hexacell.text.screens.questions import ABORTING, again_question, question_view
from hexacell.text.screens.run_picture import header_line, refusal_text
from hexacell.text.screens.views import Banner, FaultView, QuestionView, Urgency
from procedures.calibration.calibration import Mode
from procedures.engine.command_loop import Status
from procedures.engine.commands import Abort, Answer, MeasureAgain, Pause, Resume, Undo
from procedures.run.questions import StepFailure
from procedures.steps import events

if TYPE_CHECKING:
    from hexacell.drawing.shapes import Scene

SPEEDS = (0.0, 1.0, 10.0, 60.0, 600.0)
"""Speeds of a recorded run, as multiples of that at which it was recorded; the first is standstill."""


class ScreenModel:
    """Views to be shown, and actions that may be asked for; ``now`` gives seconds.

    The views are those of this moment and cost a few milliseconds at most; what takes longer is awaited.
    Everything that is awaited raises ``HexacellError``.

    Args:
        devices: who watches the devices already; nobody if None.

    Attributes:
        run: the run that is followed, live or recorded.
        devices: what the devices show.
        changed: set whenever there may be something else to show.
    """

    def __init__(
        self,
        workplace: Workplace,
        now: Callable[[], float] = time.monotonic,
        *,
        devices: DeviceWatcher | None = None,
    ) -> None:
        self._workplace = workplace
        self.changed = asyncio.Event()
        self.run = RunFollower(now, self._after_run, self.changed.set)
        self._devices = devices or DeviceWatcher(workplace.watch, now, self.changed.set)
        self._devices.watch, self._devices.on_change = workplace.watch, self.changed.set
        self.devices = ShownDevices(self.run, self._devices, lambda: workplace.cell.settings, now)
        self._run_is_over = asyncio.Event()
        self._is_starting = False
        self._readiness = Readiness(workplace, self._devices)
        self._history = RunHistory(workplace, self._devices)
        self._scene: Scene | None = None
        self._reviewed: tuple[tuple[object, ...], dict[str, tuple[Any, ...]]] | None = None

    async def attend(self) -> None:
        """Follow the cell and its run until cancelled."""
        try:
            running = await self._workplace.attach()
            if running is None:
                self._devices.start()
            else:
                await self._devices.stop()
                await self.run.follow(running)
            while True:
                await self._history.read()
                await self._run_is_over.wait()
                self._run_is_over.clear()
        finally:
            await self.run.stop()
            await self._devices.stop()

    def _after_run(self) -> None:
        """The devices are free, and there is one more run in the history."""
        self._devices.start()
        self._run_is_over.set()

    async def draw_robot(self) -> None:
        """Draw the robot for its screen, which takes a third of a second."""
        from hexacell.services.robot_view import first_scene  # noqa: PLC0415 - scipy, after the values

        self._scene = await asyncio.to_thread(first_scene, self._workplace.cell)
        self.changed.set()

    # Views.

    @property
    def runs(self) -> tuple[PastRun, ...] | None:
        """The runs of the cell, the latest first; None until they are read."""
        return self._history.runs

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
        settings = self._workplace.cell.settings
        simulated = " │ SIMULATED" if settings.simulation is not None else ""
        return header_line(f"{settings.name}{simulated}", self.run.picture)

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
                known = self._readiness
                return banner.preflight_banner(
                    known.items(self._live()[0]),
                    is_checked=known.checked is not None,
                    is_checking=known.is_checking,
                    is_running=self._is_running,
                )
            case _:
                return banner.history_banner(self.runs)

    def shown(self, screen: str) -> dict[str, tuple[Any, ...]]:
        """What the parts of a screen show now, by their names: what each ``show`` is called with."""
        cell, picture = self._workplace.cell, self.run.picture
        match screen:
            case "cell":
                warnings = [(one, Urgency.ATTENTION) for one in self._workplace.warnings]
                facts = ([*warnings, *((one, Urgency.CALM) for one in cell_facts(cell))],)
                cards = (device_cards(*self._live()),)
                return {"cards": cards, "facts": facts, "robot": (self._scene,)}
            case "preflight":
                return self._readiness.checklist(self._live()[0])
            case "plan":
                return self._readiness.poses()
            case "measure":
                limit = cell.settings.identification.target_mm or cell.settings.acceptance.position_mm
                return {
                    "progress": (progress(picture, cell.settings),),
                    "gauges": (self.devices.gauges(),),
                    "records": (record_rows(picture),),
                    "accuracy": (accuracy_plot(picture, limit),),
                }
            case "review":
                return self._result()
            case _:  # the history
                return self._history.shown()

    @property
    def described(self) -> tuple[str, tuple[str, ...]]:
        """The whole cell file: what it is, and its lines."""
        cell = self._workplace.cell
        title = f"{cell.path.name}: behind each value its line in the file, or default"
        return title, tuple(describe(cell).splitlines())

    def _live(self) -> tuple[LiveSnapshot | None, float]:
        """What the devices showed last, and how long ago, s."""
        return self.devices.live(is_running=self._is_running)

    def _result(self) -> dict[str, tuple[Any, ...]]:
        """The parts of the result; made again where something has changed beside the live values."""
        picture, may_write = self.run.picture, bool(self.proposing_run)
        seen = (picture.state, picture.question, may_write)
        if self._reviewed is None or not all(map(is_, self._reviewed[0], seen)):
            shown = reviewing.parts(picture, self._workplace.cell.settings, may_write=may_write)
            self._reviewed = (seen, shown)
        return self._reviewed[1]

    def question(self) -> QuestionView | None:
        """The question that waits, if one does and may be answered here."""
        picture = self.run.picture
        if picture.question is None or not picture.may_command:
            return None
        return question_view(picture.question, picture.live)

    def fault(self) -> FaultView | None:
        """The latest fault; those of a recorded run are long past, and what was declined is none.

        None either where a person is asked how to continue, which says what went wrong, or has answered.
        """
        picture, setback = self.run.picture, self.run.picture.setback
        is_told = isinstance(getattr(picture.question, "subject", None), StepFailure)
        is_told = is_told or (isinstance(setback, events.Failed) and setback.is_of_a_question)
        is_told = is_told or bool(picture.why_not_written) or picture.is_recorded
        return None if setback is None or is_told else fault_view(setback)

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
                is_over, needs = self.run.picture.status is Status.ENDED, {asked.UNDO, asked.MEASURE_AGAIN}
                is_void = action in needs and not records_by_name(self.run.picture)
                return self.may_leave_run and not is_over and not is_void
            case asked.STEP | asked.PLAY:
                return self._recording is not None
            case asked.TAKE_CONTROL:
                return self._is_running and not self.run.picture.may_command
            case asked.START if not self._may_start(argument):
                return False
            case asked.CHECK | asked.START | asked.EXCLUDE | asked.ROLL_BACK | asked.APPLY:
                return not (self._is_running or self._readiness.is_checking or self._is_starting)
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
            case ScreenAction.MEASURE_AGAIN if argument:
                record = records_by_name(self.run.picture)[argument]
                await self.run.give(MeasureAgain(record.at, record.orientation))
            case ScreenAction.MEASURE_AGAIN if at is not None:
                await self.run.give(MeasureAgain(at))
            case ScreenAction.MEASURE_AGAIN:
                raise UsageError("no point is being measured now")
            case ScreenAction.ABORT:
                await self.run.give(Abort("a person ended it"))
            case ScreenAction.TAKE_CONTROL if connection is not None:
                await connection.take_control()
            case ScreenAction.CHECK:
                await self._readiness.check(argument)
            case ScreenAction.START:
                await self._start(argument)
            case ScreenAction.PREVIEW:
                await self._readiness.preview(argument)
            case ScreenAction.EXCLUDE:
                await self._readiness.toggle_exclusion(argument)
            case ScreenAction.COMPARE:
                await self._history.ask(workplace.compare(argument))
            case ScreenAction.DRIFT:
                await self._history.ask(workplace.drift())
            case ScreenAction.ROLL_BACK:
                return await self._history.change_config(workplace.roll_back, argument)
            case ScreenAction.APPLY:
                return await self._history.change_config(workplace.apply, argument)
            case ScreenAction.OPEN:
                await self.run.follow(await workplace.open_run(argument))
            case ScreenAction.UNFOLD:
                self._readiness.unfold()
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
            case ScreenAction.MEASURE_AGAIN if argument:
                return again_question(argument)
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

    async def _start(self, what: str) -> None:
        """Checked again, as anything may have changed since somebody looked."""
        await self._readiness.check(what)
        if not self._readiness.is_ready:
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

    def _wind(self, recording: RecordedRun, action: ScreenAction, argument: str) -> None:
        """Step to an end or by a number of events; play or halt, ``+`` faster, ``-`` slower."""
        if action is ScreenAction.PLAY:
            cursor = self.run.picture.cursor
            if cursor is not None and cursor.sequence == cursor.last and not argument:
                recording.jump(1)  # from its end there is nothing to play
            speed = 0.0 if cursor is None else cursor.speed
            place = SPEEDS.index(speed) if speed in SPEEDS else 0
            wanted = {"+": place + 1, "-": place - 1}.get(argument, 0 if place else 1)
            recording.set_speed(SPEEDS[min(max(wanted, 0), len(SPEEDS) - 1)])
        elif (end := {"first": 1, "last": recording.last}.get(argument)) is not None:
            recording.jump(end)
        else:
            recording.step(int(argument or 1))
