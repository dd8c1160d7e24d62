"""Revisit: back at a set's reference after an interruption, the set goes on or is measured again."""

from dataclasses import replace
from typing import ClassVar, Literal

from drivers.errors import GaugeAtEnd
from hexacell.campaign.time_model import TimeKind
from hexacell.errors import HexacellError, consists_only_of
from hexacell.measurements.records import deviation_of
from procedures.resources.run_resources import RunResources
from procedures.run.keys import Phase, ThreeNumbers
from procedures.run.readings import Reading, in_words
from procedures.run.state import RunState
from procedures.steps.base import EventOfSet, StepOfSet
from procedures.steps.close import slip_in_words


class ReferenceConfirmed(EventOfSet):
    """The reference was read again after an interruption: ``change_mm`` is small, the set continues."""

    kind: Literal["confirmed"] = "confirmed"
    change_mm: ThreeNumbers
    reading: Reading

    def applied_to(self, state: RunState) -> RunState:
        return state.with_changed_set(self.at, reference_unverified=False)

    def text(self, state: RunState) -> str:
        return f"{self.at.name} continues: its reference is unchanged"


class SetInvalidated(EventOfSet):
    """The set does not count and is measured again. Its records stay in the journal.

    There is a ``reading`` if its reference was read again and had changed.
    """

    kind: Literal["voided"] = "voided"
    reason: str
    reading: Reading | None = None

    def applied_to(self, state: RunState) -> RunState:
        """A mounting of a length check whose zero is in doubt takes all mountings with it."""
        takes_all = self.at.phase is Phase.LENGTH and bool(state.set(self.at).samples)
        lost = {key for key in state.sets if key == self.at or (takes_all and key.phase is Phase.LENGTH)}
        kept = {key: value for key, value in state.sets.items() if key not in lost}
        invalidated = state.invalidated + 1
        return replace(state, sets=kept, at_pose=None, invalidated=invalidated, gauges_tried=False)

    def text(self, state: RunState) -> str:
        return f"{self.at.name} is measured again: {self.reason}"


class Revisit(StepOfSet):
    """Back at a set's reference after an interruption: see whether the gauges kept their zero."""

    kind: Literal["revisit"] = "revisit"

    outcomes: ClassVar = (ReferenceConfirmed, SetInvalidated)
    takes: ClassVar[TimeKind] = TimeKind.READING
    doing: ClassVar[str] = "reading the reference again, after an interruption"

    async def perform(self, run: RunResources, state: RunState) -> ReferenceConfirmed | SetInvalidated:
        """Read again and compare; a plunger at its end voids the set."""
        try:
            reading = await run.read(state)
        except HexacellError as error:
            if not consists_only_of(error, GaugeAtEnd):
                raise
            return SetInvalidated(at=self.at, reason=str(error))
        await run.check_gauges()
        change = run.since_reference(state, self.at, reading)
        limit_mm, joint_limit = run.settings.reference_agreement
        is_beyond = change.exceeds(limit_mm)
        # Noise that was measured says better than a stated limit whether gauges were moved.
        is_measured = state.noise is not None and run.settings.guards.limits != "fixed"
        if (leg := change.slipped_encoder()) is not None:
            shown = slip_in_words(change, leg, run.settings.mechanism.words.joint_unit)
        elif is_beyond or change.is_unlikely(0.0 if is_measured else limit_mm):
            shown = f"the gauges show {in_words(change.unexplained_mm)} that the encoders do not explain"
            shown += f", more than {f'{limit_mm:g} mm' if is_beyond else 'chance explains'}"
        elif (leg := change.leg_beyond(joint_limit)) is not None:
            shown = f"q{leg + 1} shows {change.joints[leg]:+.3f}, more than {joint_limit:g}"
        else:
            change_mm = deviation_of(change.unexplained_mm)
            return ReferenceConfirmed(at=self.at, change_mm=change_mm, reading=reading)
        return SetInvalidated(at=self.at, reason=f"back at its reference {shown}", reading=reading)
