"""Commit: the proposed geometry is written to the controller, once it is approved."""

from dataclasses import replace
from typing import ClassVar, Literal

from hexacell.config.change import ConfigChange
from hexacell.config.write_record import WriteKind
from hexacell.errors import LimitError
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.resources.run_resources import RunResources
from procedures.run.questions import PendingChange, ask_approval
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, StepWithoutMotion


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
        change = ConfigChange.load(run.folder.proposal).to_files(run.cell.config_paths)
        approved_by = await self._approval(run, state, change)
        cause = run.config.cause(WriteKind.RESULT, "its result, to be verified", by=approved_by)
        await run.config.apply(change, run.folder.path, cause)
        return Committed(approved_by=approved_by)

    async def _approval(self, run: RunResources, state: RunState, change: ConfigChange) -> str:
        """Who approves: the cell file where all gates passed, or a person."""
        gates = state.proposed.gates if state.proposed else ()
        if run.settings.acceptance.approval == "automatic" and all(gate.passed for gate in gates):
            return "the cell file: within its limits"
        pending = pending_change(state, change, gates)
        name = await run.operator.ask(ask_approval(pending, cell=run.settings.name))
        if name is None:
            raise LimitError("the new geometry was declined; nothing was applied")
        return name


def pending_change(
    state: RunState, change: ConfigChange, conditions: tuple[AcceptanceGate, ...]
) -> PendingChange:
    """The proposed change of a run, with the gates for writing it, as a person is asked about it."""
    moved = state.proposed.displacement if state.proposed else None
    improvement = state.identified.improvement if state.identified else None
    corrections, terms = change.changed_corrections, state.found_terms
    return PendingChange(conditions, change.diff, moved, improvement, corrections, terms)
