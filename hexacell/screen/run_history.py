"""The runs of a cell so far, what was asked about them, and changes of the config that follow."""

from collections.abc import Awaitable, Callable
from typing import Any

from hexacell.config.versions import ConfigEditedSince
from hexacell.errors import HexacellError
from hexacell.screen.device_watcher import DeviceWatcher
from hexacell.screen.workplace import Workplace
from hexacell.services.history.run_index import PastRun
from hexacell.text.config_changes import RELOAD, versions_text
from hexacell.text.screens import past_runs
from hexacell.text.screens.questions import PERSON


class RunHistory:
    """The runs of a cell; ``runs``: the latest first, None until they are read."""

    def __init__(self, workplace: Workplace, devices: DeviceWatcher) -> None:
        self._workplace, self._devices = workplace, devices
        self.runs: tuple[PastRun, ...] | None = None
        self._said: tuple[str, ...] = ()

    def shown(self) -> dict[str, tuple[Any, ...]]:
        """The parts of the history's screen."""
        return {
            "runs": (past_runs.run_rows(self.runs or ()),),
            "trend": (past_runs.trend_plot(self.runs or ()),),
            "comparison": (self._said or past_runs.NOTHING_ASKED,),
        }

    async def read(self) -> None:
        """Read which runs there are; where that fails, the screen says why."""
        try:
            self.runs = await self._workplace.runs()
        except HexacellError as error:
            self.runs, self._said = (), tuple(str(error).splitlines())

    async def ask(self, answer: Awaitable[tuple[str, ...]]) -> None:
        """Show the answer to what is asked about the runs; raises ``HexacellError``."""
        self._said = await answer

    async def change_config(
        self, change: Callable[[str, str], Awaitable[tuple[str, ...]]], run: str
    ) -> str:
        """Write the proposal of a run, or restore its config; the most important line of what was done.

        Where somebody has edited the config since, the three versions are shown.
        """
        try:
            async with self._devices.released():
                done = await change(run, PERSON)
                # Below a long change nobody would see it.
                self._said = (RELOAD, "", *done) if RELOAD in " ".join(done) else done
        except ConfigEditedSince as edited:
            self._said = tuple(versions_text(edited.versions).splitlines())
            raise
        await self.read()
        return RELOAD if RELOAD in self._said else self._said[-1]
