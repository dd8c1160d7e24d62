"""The runs of a cell so far, what was asked about them, and changes of the config that follow."""

from collections.abc import Awaitable, Callable
from typing import Any

from hexacell.config.versions import ConfigEditedSince
from hexacell.errors import HexacellError
from hexacell.screen.watching import DeviceWatcher
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

    async def compare(self, run: str) -> None:
        """Compare a run with the one before it; raises ``HexacellError``."""
        self._said = await self._workplace.compare(run)

    async def drift(self) -> None:
        """Show the drift of the parameters; raises ``HexacellError``."""
        self._said = await self._workplace.drift()

    async def roll_back(self, run: str) -> str:
        """Restore the config of a run, or undo it; the most important line of what was done."""
        return await self._change_config(self._workplace.roll_back, run)

    async def apply(self, run: str) -> str:
        """Write the proposal of a run; the most important line of what was done."""
        return await self._change_config(self._workplace.apply, run)

    async def _change_config(
        self, change: Callable[[str, str], Awaitable[tuple[str, ...]]], run: str
    ) -> str:
        """Where somebody has edited the config since, the three versions are shown."""
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
