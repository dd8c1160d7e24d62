"""Changes of the config that must be reverted although no decision of the procedure asks for it.

Either the event of a change could not be journalled, or a run ends early.
"""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.errors import HexacellError, Interruption, SeveralErrors, WriteBackUndone
from procedures.run.state import RunState
from procedures.run.trips import may_still_move
from procedures.steps.base import BaseEvent, BaseStep
from procedures.steps.commit import Committed
from procedures.steps.lend import ProvisionalApplied
from procedures.steps.roll_back import RollBack
from procedures.steps.take_back import TakeBack


@dataclass(frozen=True, slots=True)
class Reversal:
    """A transaction to revert.

    Attributes:
        step: the step that reverts it.
        failure: what to report if that fails; empty if the next resumption tries again.
        is_recorded: whether the step is journalled, as any other is.
    """

    step: BaseStep
    failure: str
    is_recorded: bool = True

    def undone(self, error: BaseException) -> BaseException:
        """The error to report once it is reverted: of a written result, that it was undone, and why."""
        is_result = isinstance(self.step, RollBack) and self.is_recorded
        if not is_result or not isinstance(error, HexacellError) or may_still_move(error):
            return error
        return WriteBackUndone(
            f"the new geometry was written and could not be verified; the old config is back. {error}"
        )

    def failed(self, cause: BaseException, error: HexacellError) -> BaseException:
        """The error to report if it cannot be reverted: the cause, and why, unless a resumption may."""
        if not self.failure or not isinstance(cause, HexacellError):
            return cause
        return SeveralErrors(self.failure, [cause, error])


def revert_unrecorded(event: BaseEvent, state: RunState) -> Reversal | None:
    """What to revert if an event could not be journalled; ``state`` is the one without it."""
    failure = "the controller has {}, which could be neither noted nor taken back"
    if isinstance(event, Committed) and state.committed is None:
        return Reversal(RollBack(), failure.format("the new geometry"), is_recorded=False)
    if isinstance(event, ProvisionalApplied) and not state.provisional_active:
        return Reversal(TakeBack(), failure.format("a provisional geometry"), is_recorded=False)
    return None


def revert_at_end(state: RunState, error: BaseException) -> Reversal | None:
    """What to revert if an error ends the run.

    A result that was not verified is reverted after a failure; a person who interrupts may resume and
    verify it. A provisional geometry is reverted where the robot is at a reference. At other poses the
    joint variables may belong to no pose of the old geometry; the resumed run reverts it.
    """
    is_failure = isinstance(error, HexacellError) and not isinstance(error, Interruption)
    if is_failure and state.is_unverified:
        return Reversal(RollBack(), "the new geometry was not verified, and could not be taken back")
    is_at_reference = state.at_pose is not None and state.at_pose[1] == 1
    if state.config_write_pending or (state.provisional_active and is_at_reference):
        return Reversal(TakeBack(), "")
    return None
