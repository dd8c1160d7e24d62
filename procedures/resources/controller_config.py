"""The controller made ready, and its config during a run: changes, each a transaction, and edits.

A run makes two changes: a provisional geometry while the points are measured, and the result. One step
applies a change, another reverts it::

    change        applied by    reverted by    backup and receipt
    provisional   lend          take back      <run>/lent
    result        commit        roll back      <run>

A transaction is begun in the journal by its step, written with a receipt that can undo it, read by the
controller, and confirmed in the journal by its event; each write of the file leaves a record beside the run
folders (:mod:`~hexacell.config.write_record`). If the controller does not read a new geometry,
the file is restored before the error is raised. A crash or a cancellation in between leaves a whole file,
old or new, and the receipt; applying and reverting may both be repeated from there.

The records of a run are commanded with the geometry of its config. The file must therefore be the one that
the run began with, or the one that the run itself wrote and has not reverted.
"""

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import TypeVar

from drivers.errors import StartupNotPermitted
from drivers.interfaces import Controller, StartupAction, StartupActions
from hexacell.cell.loader import Cell
from hexacell.config.change import RECEIPT, ConfigChange, Receipt, propose
from hexacell.config.layout import ConfigLayout, Contents, fingerprint, fingerprint_of, read_contents
from hexacell.config.write_back import commit, rollback
from hexacell.config.write_record import THE_RUN, WriteCause, WriteKind, recorded_write
from hexacell.errors import FileError, HexacellError, Interruption, UsageError, WriteBackUndone
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.runs.run_folder import RunFolder, run_folders
from procedures.guards.guards import Guards
from procedures.run.cancellation import in_thread
from procedures.run.questions import YES, Operator, ask_startup
from procedures.run.state import RunState

Result = TypeVar("Result")

_RESETS = frozenset({StartupAction.RESET_INITIAL_ESTOP, StartupAction.RESET_ESTOP})


@dataclass(eq=False)
class Startup:
    """Makes the controller of one run ready, by the word of the cell file or of a person.

    An emergency stop is a person's to reset. The program does it only before a run begins: of a controller
    that has been in one since it was started, where the cell file says so, of any other where a person
    does. One that came during a run is reset at the controller, however the run is continued. Switching on
    and homing need the cell file's word or a person's. A reload command may restart the controller, which
    is then in the emergency stop that it starts in: the cell file's word counts for that as well.

    The cell file's word is ``stated``; ``may_have_begun`` is whether an order was given that could have
    ended its first emergency stop.
    """

    controller: Controller
    guards: Guards
    operator: Operator
    stated: StartupActions
    may_have_begun: bool = False

    async def prepare(self, state: RunState) -> None:
        """Make it ready to move; raises ``HexacellError`` if that cannot be done.

        An ``AnswerNeeded`` is raised without a person to permit or to do something, an ``Interruption`` if
        that person refuses.
        """
        is_during_run = self.may_have_begun or state.is_in_estop
        await self._prepare_asking(_RESETS if is_during_run else frozenset())

    async def reload(self) -> None:
        """Make it reload its config, and make sure that it did; raises as :meth:`prepare` does."""
        try:
            await self.guards.while_not_ready(lambda: self.controller.reload(self.stated))
        except StartupNotPermitted:
            await self._prepare_asking(frozenset({StartupAction.RESET_ESTOP}))
        await self.guards.locate()

    async def _prepare_asking(self, theirs: StartupActions) -> None:
        """Make it ready; ``theirs`` is what a person does, and this program never."""
        granted: StartupActions = frozenset()
        while True:
            try:
                await self._prepare((self.stated | granted) - theirs)
            except StartupNotPermitted as refusal:
                is_theirs = refusal.needed in theirs
                question = ask_startup(refusal.needed, str(refusal), is_theirs=is_theirs)
                if await self.operator.ask(question) != YES:
                    raise Interruption(f"{refusal}, which was left as it is") from None
                granted |= frozenset() if is_theirs else {refusal.needed}
            else:
                return

    async def _prepare(self, permitted: StartupActions) -> None:
        async def order() -> None:
            before, self.may_have_begun = self.may_have_begun, True
            try:
                await self.controller.prepare(permitted)
            except StartupNotPermitted:
                self.may_have_begun = before
                raise

        await self.guards.prepare(order)


_log = logging.getLogger(__name__)

PROVISIONAL_FOLDER = "lent"

_NAMES = {WriteKind.RESULT: "the new geometry", WriteKind.PROVISIONAL: "the provisional geometry"}

_UNDOES = {WriteKind.RESULT: WriteKind.TAKEN_BACK, WriteKind.PROVISIONAL: WriteKind.PROVISIONAL_TAKEN_BACK}


@dataclass(eq=False)
class ConfigChanges:
    """Changes the config of one run, makes the controller read it, and notices where somebody edited it.

    ``require_evidence`` raises ``EvidenceLost`` if there is no journal on which a change could rest.
    """

    cell: Cell
    startup: Startup
    folder: RunFolder
    require_evidence: Callable[[], None]
    _unedited: Contents | None = field(default=None, init=False)

    @property
    def provisional_backup(self) -> Path:
        """Where the config is kept while the controller has a provisional geometry."""
        return self.folder.path / PROVISIONAL_FOLDER

    def change_to(
        self, geometry: Geometry, state: RunState, corrections: Corrections | None = None
    ) -> ConfigChange:
        """The change of the config to a geometry in the controller's frames; nothing is written.

        Without ``corrections`` it keeps those that it has.
        """
        return propose(
            self.cell.config_paths,
            ConfigLayout.of(self.cell.settings),
            geometry,
            corrections,
            fingerprint_at_start=state.started.config_sha256 if state.started else "",
        )

    def cause(self, kind: WriteKind, why: str, *, by: str = THE_RUN) -> WriteCause:
        """The cause of a write by this run."""
        return WriteCause(kind, by, self.folder.name, why)

    async def apply(
        self, change: ConfigChange, backup: Path, cause: WriteCause, action: str | None = None
    ) -> None:
        """Write a change and make the controller read it; raises ``HexacellError``.

        That is a ``WriteBackUndone`` if the controller did not read it; its config is as before.
        """
        await in_thread(self.require_evidence)  # a person may have taken hours to approve it
        receipt = await self.write(change, backup, cause)
        try:
            await self.startup.reload()
        except HexacellError as error:
            undoing = self.cause(_UNDOES[cause.kind], f"the controller did not take it: {error}")
            await self._recorded(undoing, lambda: rollback(receipt))
            has_old_geometry = False
            with suppress(HexacellError):
                await self.startup.controller.reload(self.startup.stated)
                has_old_geometry = (await self.startup.guards.position.read()).trip is None
            raise WriteBackUndone(
                f"the controller did not take {_NAMES[cause.kind]} ({error}); its config is restored",
                subject=receipt.path,
                action=action if has_old_geometry else "Restart the controller before it moves",
            ) from error

    async def write(self, change: ConfigChange, backup: Path, cause: WriteCause) -> Receipt:
        """Write a change; the controller is not made to read it yet."""
        return await self._recorded(cause, lambda: commit(change, backup))

    async def restore(self, backup: Path, cause: WriteCause) -> None:
        """Restore what a backup keeps; the controller is not made to read it yet."""
        receipt = Receipt.of(backup)
        await self._recorded(cause, lambda: rollback(receipt))

    def require_begun_with(self, state: RunState) -> None:
        """Make sure that the config is the one that the run began with; raises ``FileError``."""
        if state.started and fingerprint(*self.cell.config_paths) != state.started.config_sha256:
            raise _edited(self.cell.config_path)

    def require_unedited(self, state: RunState) -> None:
        """Make sure that the config is as the run has it; while it is being changed, it may be either.

        Raises ``FileError``, with the first line that differs if this process has seen it before.
        """
        if not (expected := expected_fingerprints(self.folder, state)):
            return
        found = read_contents(self.cell.config_paths)
        if fingerprint_of(found) not in expected:
            raise _edited(*self._first_difference(found))
        self._unedited = found

    def _first_difference(self, found: Contents) -> tuple[Path, int | None]:
        """The first file that differs, and its first line that does; no line if that is not known."""
        for path, old, new in zip(self.cell.config_paths, self._unedited or (), found, strict=False):
            if old != new:
                lines = zip_longest(old.split(b"\n"), new.split(b"\n"))
                return path, next((row for row, (one, two) in enumerate(lines, 1) if one != two), None)
        return self.cell.config_path, None

    async def _recorded(self, cause: WriteCause, write: Callable[[], Result]) -> Result:
        """Write, and record it; without a record the run goes on, warned: its journal has the write."""
        layout, paths = ConfigLayout.of(self.cell.settings), self.cell.config_paths

        def written() -> Result:
            with recorded_write(self.folder.siblings, paths, layout, cause) as recording:
                result = write()
            if recording.problem:
                _log.warning("%s", recording.problem)
            return result

        return await in_thread(written)


def holds_provisional(folder: RunFolder, config: tuple[Path, ...]) -> bool:
    """Whether a config holds the provisional geometry that a run wrote; raises ``FileError``."""
    backup = folder.path / PROVISIONAL_FOLDER
    return (backup / RECEIPT).is_file() and Receipt.of(backup).sha256_after == fingerprint(*config)


def require_no_provisional(cell: Cell) -> None:
    """Refuse a config that holds the provisional geometry of an interrupted run.

    Raises:
        UsageError: names that run.
    """
    for folder in run_folders(cell):
        if holds_provisional(folder, cell.config_paths):
            raise UsageError(
                f"the run {folder.path} was interrupted and left its provisional geometry here",
                subject=cell.config_path,
                action="Resume that run, which restores the geometry",
            )


def expected_fingerprints(folder: RunFolder, state: RunState) -> set[str]:
    """The fingerprints that the config may have by now; empty where that is not known."""
    if state.started is None or state.config_write_pending or state.rolling_back:
        return set()
    if state.committed is not None and not state.rolled_back:
        return {Receipt.of(folder.path).sha256_after}
    if state.provisional_active:
        return {Receipt.of(folder.path / PROVISIONAL_FOLDER).sha256_after}
    expected = {state.started.config_sha256}
    if state.proposed is not None and (folder.path / RECEIPT).is_file():  # killed while it was written
        expected.add(ConfigChange.load(folder.proposal).sha256_after)
    return expected


def _edited(path: Path, line: int | None = None) -> FileError:
    """The error for a config that is not as the run has it."""
    return FileError(
        "the config changed since the run began, whose records were commanded with the geometry before",
        subject=path,
        line=line,
        action="Undo the edit and retry; if the run has ended, resume it then",
    )
