"""What is done between a failure and the next attempt."""

from __future__ import annotations

from hexacell.cell.recovery import Action
from hexacell.errors import HexacellError
from procedures.devices.reconnection import reconnect
from procedures.engine.recovery_policy import RecoveryPolicy
from procedures.engine.step_executor import StepExecutor
from procedures.run import events
from procedures.run.state import RunState
from procedures.run.steps import SetKey


async def prepare_retry(
    performer: StepExecutor,
    policy: RecoveryPolicy,
    error: HexacellError,
    failure: events.Failed,
    state: RunState,
) -> list[events.SetInvalidated]:
    """Wait, open again what was lost, and say which sets are void by that or by what was decided.

    Raises:
        HexacellError: a device does not come back, or another one does.
    """
    if not failure.asked:
        await performer.clock.sleep(policy.wait_s)
    zero_is_lost = False
    if failure.action is not Action.RETRY:
        known = state.started.devices if state.started else ()
        zero_is_lost = await reconnect(performer.devices, error, known)
    if zero_is_lost:
        return _voided(_open_sets(state), "a gauge was opened again, its zero is void")
    if failure.action is Action.REDO_SET:
        return _voided(_of(failure, state), failure.reason)
    return []


def _voided(keys: list[SetKey], reason: str) -> list[events.SetInvalidated]:
    return [events.SetInvalidated(at=key, reason=reason) for key in keys]


def _of(failure: events.Failed, state: RunState) -> list[SetKey]:
    """The set that the failed step belongs to; where none was decided, all that are open."""
    key = getattr(failure.step, "at", None)
    return [one for one in _open_sets(state) if key is None or one == key]


def _open_sets(state: RunState) -> list[SetKey]:
    return [key for key, measured in state.sets.items() if not measured.closed]
