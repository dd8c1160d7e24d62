"""Changes of the controller's config during a run, each a transaction.

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

Two cases need a revert that no decision of the procedure asks for. :func:`revert_unrecorded` is for a
change whose event could not be journalled, :func:`revert_at_end` for a run that ends early. The engine
carries out both.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.config.change import ConfigChange, propose
from hexacell.config.layout import fingerprint
from hexacell.config.receipt import RECEIPT, Receipt
from hexacell.config.write_back import commit, rollback
from hexacell.config.write_record import THE_RUN, WriteCause, WriteKind, recorded_write
from hexacell.errors import AnswerNeeded, HexacellError, Interruption, LimitError, WriteBackUndone
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import config_layout
from hexacell.runs.run_folder import RunFolder
from procedures.calibration.workflow import Calibration, geometry_of
from procedures.devices.device_set import Devices
from procedures.engine.config_edits import PROVISIONAL_FOLDER, edited
from procedures.engine.startup import Startup
from procedures.run import events
from procedures.run.cancellation import in_thread
from procedures.run.questions import Operator, ask_acceptance, ask_approval
from procedures.run.state import RunState
from procedures.run.steps import Compute
from procedures.run.trips import may_still_move

_log = logging.getLogger(__name__)

TAKE_BACK = Compute(kind="take back")
ROLL_BACK = Compute(kind="roll back")


@dataclass(frozen=True, eq=False)
class ConfigTransactions:
    """Applies and reverts the changes of one run; each method gives the event that confirms it.

    Raises:
        WriteBackUndone: the controller did not read the new geometry; its config is as before.
        HexacellError: there is no geometry, or the config cannot be written or read.
    """

    cell: Cell
    calibration: Calibration
    startup: Startup
    devices: Devices
    folder: RunFolder
    operator: Operator

    def change_to(self, geometry: Geometry, state: RunState) -> ConfigChange:
        """The change of the config to a geometry in the controller's frames; nothing is written."""
        settings = self.cell.settings
        return propose(
            self.cell.config_paths,
            config_layout(settings),
            geometry,
            fingerprint_at_start=state.started.config_sha256 if state.started else "",
        )

    async def apply_provisional(self, state: RunState) -> events.ProvisionalApplied:
        """Give the controller a geometry to measure the remaining points with."""
        geometry = await in_thread(self.calibration.provisional_geometry, state)
        await self._apply(
            await in_thread(self.change_to, self.calibration.robot.for_controller(geometry), state),
            self._provisional_backup,
            self._cause(WriteKind.PROVISIONAL, "to measure the remaining points with it"),
            action="Correct that, or run without `provisional`",
        )
        return events.ProvisionalApplied(geometry=geometry.document(), folder=PROVISIONAL_FOLDER)

    async def apply_result(self, state: RunState) -> events.Committed:
        """Give the controller the proposed geometry, once it is approved."""
        conditions = state.proposed.gates if state.proposed else ()
        refused = [gate.sentence for gate in conditions if not gate.passed and not gate.needs_person]
        if refused:
            raise LimitError("the new geometry is refused: " + " ".join(refused))
        change = ConfigChange.load(self.folder.proposal)
        approved_by = await self._approval(state, change)
        cause = self._cause(WriteKind.RESULT, "its result, to be verified", by=approved_by)
        await self._apply(change, self.folder.path, cause)
        return events.Committed(approved_by=approved_by)

    async def _approval(self, state: RunState, change: ConfigChange) -> str:
        proposed = state.proposed
        conditions = proposed.gates if proposed else ()
        automatic = self.cell.settings.acceptance.approval == "automatic"
        if automatic and all(gate.passed for gate in conditions):
            return "the cell file: within its limits"
        displacement = proposed.displacement if proposed else None
        improvement = state.identified.improvement if state.identified else None
        question = ask_approval(
            conditions, change.diff, displacement, improvement, cell=self.cell.settings.name
        )
        name = await self.operator.ask(question)
        if name is None:
            raise LimitError("the new geometry was declined; nothing was applied")
        return name

    async def _apply(
        self, change: ConfigChange, backup: Path, cause: WriteCause, action: str | None = None
    ) -> None:
        receipt = await in_thread(self._commit, change, backup, cause)
        try:
            await self.startup.reload()
        except HexacellError as error:
            kind = _UNDOES[cause.kind]
            undoing = self._cause(kind, f"the controller did not take it: {error}")
            await in_thread(self._roll_back, receipt, undoing)
            raise WriteBackUndone(
                f"the controller did not take {_NAMES[cause.kind]} ({error}); its config is restored",
                subject=receipt.path,
                action=action if await self._reads_again() else "Restart the controller before it moves",
            ) from error

    def _commit(self, change: ConfigChange, backup: Path, cause: WriteCause) -> Receipt:
        with self._recorded(cause):
            return commit(change, backup)

    def _roll_back(self, receipt: Receipt, cause: WriteCause) -> None:
        with self._recorded(cause):
            rollback(receipt)

    @contextmanager
    def _recorded(self, cause: WriteCause) -> Iterator[None]:
        """Record a write; where that fails the run goes on, with a warning: its journal has the write."""
        layout = config_layout(self.cell.settings)
        with recorded_write(self.folder.siblings, self.cell.config_paths, layout, cause) as recording:
            yield
        if recording.problem:
            _log.warning("%s", recording.problem)

    def _cause(self, kind: WriteKind, why: str, *, by: str = THE_RUN) -> WriteCause:
        return WriteCause(kind, by, self.folder.name, why)

    async def _reads_again(self) -> bool:
        """Reload the restored config; whether the controller is known to have its old geometry."""
        try:
            await self.devices.controller.reload(self.startup.stated)
            return (await self.startup.guards.position.read()).trip is None
        except HexacellError:
            return False

    async def revert_provisional(self, state: RunState) -> events.ProvisionalReverted:
        """Give the controller the geometry of before the provisional one."""
        written = holds_provisional(self.folder, self.cell.config_paths)
        if written:
            cause = self._cause(WriteKind.PROVISIONAL_TAKEN_BACK, "it was to be used in the run alone")
            await in_thread(self._roll_back, Receipt.of(self._provisional_backup), cause)
        elif state.started and fingerprint(*self.cell.config_paths) != state.started.config_sha256:
            raise edited(self.cell.config_path)
        try:
            await self.startup.reload()
        except HexacellError:
            # Far from level, the slider positions may belong to no pose of the old geometry. The file
            # must not differ from what the controller has until it can be reloaded.
            if written and state.provisional is not None:
                robot = self.calibration.robot
                provisional = robot.for_controller(geometry_of(state.provisional, robot))
                change = await in_thread(self.change_to, provisional, state)
                cause = self._cause(WriteKind.PROVISIONAL, "the controller does not take the old one here")
                await in_thread(self._commit, change, self._provisional_backup, cause)
            raise
        return events.ProvisionalReverted()

    async def ask_whether_kept(self, state: RunState) -> events.ResultAccepted:
        """Ask a person whether a written geometry that did not pass stays; nothing is changed."""
        judged = state.judged
        assert judged is not None  # noqa: S101 - decided only after the verdict
        assert judged.verification is not None  # noqa: S101 - only then it is offered
        moved = state.proposed.displacement if state.proposed else None
        try:
            name = await self.operator.ask(ask_acceptance(judged.line, judged.verification, moved))
        except AnswerNeeded:
            return events.ResultAccepted(by=None, asked=False)
        return events.ResultAccepted(by=name)

    async def revert_result(self, state: RunState) -> events.RolledBack:
        """Give the controller the geometry of before the run."""
        cause = self._cause(WriteKind.TAKEN_BACK, reason_to_take_back(state))
        await in_thread(self._roll_back, Receipt.of(self.folder.path), cause)
        await self.startup.reload()
        return events.RolledBack()

    @property
    def _provisional_backup(self) -> Path:
        return self.folder.path / PROVISIONAL_FOLDER


_NAMES = {WriteKind.RESULT: "the new geometry", WriteKind.PROVISIONAL: "the provisional geometry"}
_UNDOES = {
    WriteKind.RESULT: WriteKind.TAKEN_BACK,
    WriteKind.PROVISIONAL: WriteKind.PROVISIONAL_TAKEN_BACK,
}


def reason_to_take_back(state: RunState) -> str:
    """Why a written result does not stay."""
    if state.judged is None:
        return "it could not be verified"
    nobody = state.accepted is not None and state.accepted.by is None
    return f"nobody kept it: {state.judged.line}" if nobody else state.judged.line


def holds_provisional(folder: RunFolder, config: tuple[Path, ...]) -> bool:
    """Whether a config holds the provisional geometry that a run wrote; raises ``FileError``."""
    backup = folder.path / PROVISIONAL_FOLDER
    return (backup / RECEIPT).is_file() and Receipt.of(backup).sha256_after == fingerprint(*config)


@dataclass(frozen=True, slots=True)
class Reversal:
    """A transaction to revert.

    Attributes:
        step: the step that reverts it.
        failure: what to report if that fails; empty if the next resumption tries again.
        is_recorded: whether the step is journalled, as any other is.
    """

    step: Compute
    failure: str
    is_recorded: bool = True

    def undone(self, error: BaseException) -> BaseException:
        """The error to report once it is reverted: of a written result, that it was undone, and why."""
        if self.step != ROLL_BACK or not isinstance(error, HexacellError) or may_still_move(error):
            return error
        return WriteBackUndone(
            f"the new geometry was written and could not be verified; the old config is back. {error}"
        )


def revert_unrecorded(event: events.Event, state: RunState) -> Reversal | None:
    """What to revert if an event could not be journalled; ``state`` is the one without it."""
    if isinstance(event, events.Committed) and state.committed is None:
        step, name = ROLL_BACK, "the new geometry"
    elif isinstance(event, events.ProvisionalApplied) and not state.provisional_active:
        step, name = TAKE_BACK, "a provisional geometry"
    else:
        return None
    failure = f"the controller has {name}, which could be neither noted nor taken back"
    return Reversal(step, failure, is_recorded=False)


def revert_at_end(state: RunState, error: BaseException) -> Reversal | None:
    """What to revert if an error ends the run.

    A result that was not verified is reverted after a failure; a person who interrupts may resume and
    verify it. A provisional geometry is reverted where the robot is at a reference. At other poses the
    joint variables may belong to no pose of the old geometry; the resumed run reverts it.
    """
    is_failure = isinstance(error, HexacellError) and not isinstance(error, Interruption)
    if is_failure and state.is_unverified:
        return Reversal(ROLL_BACK, "the new geometry was not verified, and could not be taken back")
    is_at_reference = state.at_pose is not None and state.at_pose[1] == 1
    if state.config_write_pending or (state.provisional_active and is_at_reference):
        return Reversal(TAKE_BACK, "")
    return None
