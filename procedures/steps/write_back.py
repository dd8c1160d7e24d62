"""The result goes to the controller: it is proposed, written, and kept by a person or rolled back."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

from hexacell.cell.fields import GeometryDocument
from hexacell.config.change import ConfigChange
from hexacell.config.write_record import WriteKind
from hexacell.errors import AnswerNeeded, LimitError
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.verdict.acceptance_gates import AcceptanceGate, gates
from procedures.run.questions import ask_acceptance, ask_approval
from procedures.steps.base import BaseEvent, Computation, StepWithoutMotion

if TYPE_CHECKING:
    from procedures.resources.run_resources import RunResources
    from procedures.run.state import RunState


class Proposed(BaseEvent):
    """The new config was saved in the run folder, and the gates for writing it were evaluated.

    ``written`` is the geometry in it; ``displacement`` is how far that moves the task poses.
    """

    kind: Literal["proposed"] = "proposed"
    gates: tuple[AcceptanceGate, ...]
    written: GeometryDocument
    displacement: TaskDisplacement | None = None

    def applied_to(self, state: RunState) -> RunState:
        return replace(state, proposed=self)


class Propose(Computation):
    """Prepare the change of the controller's config."""

    kind: Literal["propose"] = "propose"

    outcomes: ClassVar = (Proposed,)
    doing: ClassVar[str] = "preparing the new config"

    def compute(self, run: RunResources, state: RunState) -> Proposed:
        """Save the change of the config and evaluate the gates; raises ``FileError``."""
        assert state.identified is not None  # noqa: S101 - decided only after the identification
        settings, robot, result = run.settings, run.calibration.robot, state.identified.result
        identified = result.estimate(robot.mechanism.parameters)
        commanding, _ = robot.mechanism.normalize_frames(robot.controller)
        started = state.started
        conditions = gates(
            identified,
            robot.tolerance_violations(identified),
            residuals=result.residuals,
            largest_change_mm=settings.acceptance.largest_change_mm,
            before=commanding,
            expired=started.expired if settings.certificates and started is not None else None,
        )
        written = run.calibration.as_written(identified.geometry)
        change = run.config.change_to(written.geometry, state)
        change.save(run.folder.proposal, like=run.cell.config_path)
        return Proposed(
            gates=conditions, written=written.geometry.document(), displacement=written.displacement
        )


class Committed(BaseEvent):
    """The controller has read a config with the new geometry."""

    kind: Literal["committed"] = "committed"
    approved_by: str

    def applied_to(self, state: RunState) -> RunState:
        """Equal joint variables are another pose under another geometry."""
        return replace(state, committed=self).without_position()

    def text(self, state: RunState) -> str:
        return f"written to the controller, approved by {self.approved_by}"


class Commit(StepWithoutMotion):
    """Give the controller the proposed geometry."""

    kind: Literal["commit"] = "commit"

    outcomes: ClassVar = (Committed,)
    doing: ClassVar[str] = "writing the config and reloading it"

    async def perform(self, run: RunResources, state: RunState) -> Committed:
        """Write the config and have it read; raises ``WriteBackUndone`` if the controller does not."""
        conditions = state.proposed.gates if state.proposed else ()
        refused = [gate.sentence for gate in conditions if not gate.passed and not gate.needs_person]
        if refused:
            raise LimitError("the new geometry is refused: " + " ".join(refused))
        change = ConfigChange.load(run.folder.proposal)
        approved_by = await self._approval(run, state, change)
        cause = run.config.cause(WriteKind.RESULT, "its result, to be verified", by=approved_by)
        await run.config.apply(change, run.folder.path, cause)
        return Committed(approved_by=approved_by)

    async def _approval(self, run: RunResources, state: RunState, change: ConfigChange) -> str:
        """Who approves: the cell file where all gates passed, or a person."""
        proposed = state.proposed
        conditions = proposed.gates if proposed else ()
        automatic = run.settings.acceptance.approval == "automatic"
        if automatic and all(gate.passed for gate in conditions):
            return "the cell file: within its limits"
        displacement = proposed.displacement if proposed else None
        improvement = state.identified.improvement if state.identified else None
        name = await run.operator.ask(
            ask_approval(conditions, change.diff, displacement, improvement, cell=run.settings.name)
        )
        if name is None:
            raise LimitError("the new geometry was declined; nothing was applied")
        return name


class ResultAccepted(BaseEvent):
    """A person decided on a result that did not pass; ``by`` is who keeps it, null if nobody does.

    ``asked`` is whether there was somebody to ask.
    """

    kind: Literal["accepted"] = "accepted"
    by: str | None
    asked: bool = True

    def applied_to(self, state: RunState) -> RunState:
        return replace(state, accepted=self)


class Accept(StepWithoutMotion):
    """Ask whether the written geometry stays; nothing is changed."""

    kind: Literal["accept"] = "accept"

    outcomes: ClassVar = (ResultAccepted,)
    doing: ClassVar[str] = "waiting for a decision on the result"
    is_reproducible: ClassVar[bool] = False

    async def perform(self, run: RunResources, state: RunState) -> ResultAccepted:
        judged = state.judged
        assert judged is not None  # noqa: S101 - decided only after the verdict
        assert judged.verification is not None  # noqa: S101 - only then it is offered
        moved = state.proposed.displacement if state.proposed else None
        try:
            name = await run.operator.ask(ask_acceptance(judged.line, judged.verification, moved))
        except AnswerNeeded:
            return ResultAccepted(by=None, asked=False)
        return ResultAccepted(by=name)


class RolledBack(BaseEvent):
    """The controller has read the config that it had before the run, bit for bit."""

    kind: Literal["rolled back"] = "rolled back"

    def applied_to(self, state: RunState) -> RunState:
        """Without a verdict the proposal is open again, and the sets measured after it do not count."""
        state = replace(state, rolling_back=False).without_position()
        if state.judged is not None:
            return replace(state, rolled_back=True)
        kept = {key: value for key, value in state.sets.items() if not key.phase.has_new_geometry}
        return replace(state, committed=None, confirmation=None, sets=kept)

    def text(self, state: RunState) -> str:
        return "the old geometry is back in the controller"


class RollBack(StepWithoutMotion):
    """Give the controller the geometry that it had before the run."""

    kind: Literal["roll back"] = "roll back"

    outcomes: ClassVar = (RolledBack,)
    doing: ClassVar[str] = "restoring the old config"
    is_reproducible: ClassVar[bool] = False

    def begun_in(self, state: RunState) -> RunState:
        return replace(state, rolling_back=True)

    async def perform(self, run: RunResources, state: RunState) -> RolledBack:
        cause = run.config.cause(WriteKind.TAKEN_BACK, reason_to_take_back(state))
        await run.config.restore(run.folder.path, cause)
        await run.startup.reload()
        return RolledBack()


def reason_to_take_back(state: RunState) -> str:
    """Why a written result does not stay."""
    if state.judged is None:
        return "it could not be verified"
    nobody = state.accepted is not None and state.accepted.by is None
    return f"nobody kept it: {state.judged.line}" if nobody else state.judged.line
