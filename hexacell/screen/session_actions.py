"""What a person may ask for, and what it does to a workplace and its run."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from functools import partial

from hexacell.config.receipt import ConfigEditedSince
from hexacell.errors import HexacellError, UsageError
from hexacell.run_process.connection import RunConnection
from hexacell.run_process.recorded import RecordedRun
from hexacell.screen.backend import ONCE, ScreenAction
from hexacell.screen.device_watcher import DeviceWatcher
from hexacell.screen.plan_trials import PlanTrials
from hexacell.screen.run_follower import RunFollower
from hexacell.screen.workplace import Workplace
from hexacell.text.config_changes import RELOAD, versions_text
from hexacell.text.screens.questions import PERSON
from hexacell.text.screens.views import ChecklistItem, HistoryEntry
from procedures.calibration.calibration import Mode
from procedures.engine.command_loop import Status
from procedures.engine.commands import Abort, Command, MeasureAgain, Pause, Resume, Undo

OF_A_RUN = frozenset(
    {
        ScreenAction.PAUSE,
        ScreenAction.PAUSE_AT_ONCE,
        ScreenAction.UNDO,
        ScreenAction.MEASURE_AGAIN,
        ScreenAction.ABORT,
    }
)
WITHOUT_A_RUN = frozenset(
    {
        ScreenAction.CHECK,
        ScreenAction.START,
        ScreenAction.EXCLUDE,
        ScreenAction.ROLL_BACK,
        ScreenAction.APPLY,
    }
)
OF_A_RECORDING = frozenset({ScreenAction.STEP, ScreenAction.PLAY})
SPEEDS = (0.0, 1.0, 10.0, 60.0, 600.0)
"""At which a recorded run advances; the first is standstill."""


@dataclass
class Findings:
    """What was asked for so far, and what came of it.

    Attributes:
        checked: by the preflight; none before it. ``is_ready``: it found nothing.
        entries: of the history; none before it was read.
        compared: a comparison of two runs, in lines.
    """

    checked: tuple[ChecklistItem, ...] | None = None
    is_ready: bool = False
    is_checking: bool = False
    is_starting: bool = False
    entries: tuple[HistoryEntry, ...] | None = None
    compared: tuple[str, ...] = field(default=())


class SessionActions:
    """Does what was asked for."""

    def __init__(self, workplace: Workplace, run: RunFollower, devices: DeviceWatcher) -> None:
        self.findings, self.plan = Findings(), PlanTrials(workplace)
        self._workplace, self._run, self._devices = workplace, run, devices
        self._does: dict[ScreenAction, Callable[[str], Awaitable[str]]] = {
            ScreenAction.PAUSE: self._pause,
            ScreenAction.PAUSE_AT_ONCE: partial(self._give, Pause(at_once=True)),
            ScreenAction.UNDO: partial(self._give, Undo()),
            ScreenAction.MEASURE_AGAIN: self._measure_again,
            ScreenAction.ABORT: partial(self._give, Abort()),
            ScreenAction.TAKE_CONTROL: self._take_control,
            ScreenAction.CHECK: self._check,
            ScreenAction.START: self._start,
            ScreenAction.PREVIEW: self._preview,
            ScreenAction.EXCLUDE: self._exclude,
            ScreenAction.COMPARE: self._compare,
            ScreenAction.ROLL_BACK: self._roll_back,
            ScreenAction.APPLY: self._apply,
            ScreenAction.OPEN: self._open,
            ScreenAction.DRIFT: self._drift,
            ScreenAction.STEP: self._step,
            ScreenAction.PLAY: self._play,
        }

    @property
    def recording(self) -> RecordedRun | None:
        """The recorded run that is shown; none if a run goes on, or nothing is shown."""
        connection = self._run.connection
        return connection if isinstance(connection, RecordedRun) else None

    @property
    def is_running(self) -> bool:
        """Whether a run goes on that has the devices."""
        return self._run.connection is not None and self.recording is None

    def allows(self, action: ScreenAction) -> bool:
        """Whether an action has an effect now."""
        if action in OF_A_RUN:
            is_over = self._run.picture.status is Status.ENDED
            return self.is_running and self._run.picture.may_command and not is_over
        if action in OF_A_RECORDING:
            return self.recording is not None
        if action is ScreenAction.TAKE_CONTROL:
            return self.is_running and not self._run.picture.may_command
        if action in WITHOUT_A_RUN:
            return not (self.is_running or self.findings.is_checking or self.findings.is_starting)
        return True

    async def perform(self, action: ScreenAction, argument: str) -> str:
        """See :meth:`~hexacell.screen.backend.Backend.perform`."""
        if not self.allows(action):
            raise UsageError(f"{action} has no effect now")
        return await self._does[action](argument)

    async def _give(self, command: Command, _: str) -> str:
        await self._run.give(command)
        return ""

    async def _pause(self, _: str) -> str:
        is_paused = self._run.picture.status in {Status.PAUSED, Status.PAUSING}
        return await self._give(Resume() if is_paused else Pause(), "")

    async def _measure_again(self, _: str) -> str:
        at = self._run.picture.at
        if at is None:
            raise UsageError("no point is being measured now")
        return await self._give(MeasureAgain(at), "")

    async def _take_control(self, _: str) -> str:
        if self._run.connection is not None:
            await self._run.connection.take_control()
        return ""

    async def _check(self, what: str) -> str:
        found = self.findings
        found.checked, found.is_ready, found.is_checking = None, False, True
        try:
            async with self._devices.released():
                preflight = await self._workplace.check(what or Mode.OPTIMISE)
            found.checked, found.is_ready = preflight.items, preflight.is_ready
        finally:
            found.is_checking = False
        return ""

    async def _start(self, what: str) -> str:
        """Checked again, as anything may have changed since somebody looked."""
        await self._check(what)
        if not self.findings.is_ready:
            raise UsageError("not everything holds that must hold", action="Look at 2 Preflight")
        await self._devices.stop()
        self.findings.is_starting = True
        try:
            await self._follow(await self._workplace.start(what))
        except BaseException:
            self._devices.start()
            raise
        finally:
            self.findings.is_starting = False
        return ""

    async def _preview(self, how_often: str) -> str:
        is_enough = how_often == ONCE and (self.plan.is_trying or self.plan.tried is not None)
        if not is_enough:
            await self.plan.try_again()
        return ""

    async def _exclude(self, name: str) -> str:
        tried = self.plan.tried
        await self._workplace.toggle_exclusion(name, () if tried is None else tried.poses)
        await self.plan.try_again()
        return ""

    async def _compare(self, run: str) -> str:
        self.findings.compared = await self._workplace.compare(run)
        return ""

    async def _roll_back(self, run: str) -> str:
        return await self._change_config(partial(self._workplace.roll_back, run, PERSON))

    async def _apply(self, run: str) -> str:
        return await self._change_config(partial(self._workplace.apply, run, PERSON))

    async def _change_config(self, change: Callable[[], Awaitable[tuple[str, ...]]]) -> str:
        """Where somebody has edited the config since, the three versions are shown."""
        try:
            async with self._devices.released():
                self.findings.compared = await change()
        except ConfigEditedSince as edited:
            self.findings.compared = tuple(versions_text(edited.versions).splitlines())
            raise
        await self.read_history()
        said = " ".join(self.findings.compared)
        return RELOAD if RELOAD in said else self.findings.compared[-1]

    async def _drift(self, _: str) -> str:
        self.findings.compared = await self._workplace.drift()
        return ""

    async def _open(self, run: str) -> str:
        await self._follow(await self._workplace.open_run(run))
        return ""

    async def _follow(self, connection: RunConnection) -> None:
        await self._run.follow(connection)

    async def read_history(self) -> None:
        """Read which runs there are; where that fails, the history says why."""
        try:
            self.findings.entries = await self._workplace.runs()
        except HexacellError as error:
            self.findings.entries, self.findings.compared = (), tuple(str(error).splitlines())

    async def _step(self, argument: str) -> str:
        """To an end, or by a number of events."""
        if self.recording is not None:
            ends = {"first": 1, "last": self.recording.last}
            if argument in ends:
                self.recording.jump(ends[argument])
            else:
                self.recording.step(int(argument or 1))
        return ""

    async def _play(self, argument: str) -> str:
        """Halt or go on; ``+`` faster, ``-`` slower."""
        cursor = self._run.picture.cursor
        speed = 0.0 if cursor is None else cursor.speed
        place = SPEEDS.index(speed) if speed in SPEEDS else 0
        wanted = {"+": place + 1, "-": place - 1}.get(argument, 0 if place else 1)
        if self.recording is not None:
            self.recording.set_speed(SPEEDS[min(max(wanted, 0), len(SPEEDS) - 1)])
        return ""
