"""The steps that measure the held-out points, before and after the new geometry is written.

The poses are chosen in :mod:`~procedures.calibration.held_out_poses`. Those that are measured before are
measured again afterwards, for the comparison.
"""

from dataclasses import dataclass

from hexacell.errors import LimitError
from procedures.run.keys import Phase, SetKey, SixNumbers
from procedures.run.state import RunState
from procedures.steps import events
from procedures.workflow.sets import SetSteps, TravelError, reference_move, require_zero

BY_CHANCE = 3
"""Rejected poses of a set that a machine that does not repeat may have; each is measured again."""


@dataclass(frozen=True, eq=False)
class HeldOutSteps:
    """Decides on the steps that measure the chosen poses of ``point_count`` points."""

    point_count: int
    sets: SetSteps

    @property
    def _by_chance(self) -> int:
        """Rejected poses of a set that prove nothing."""
        return BY_CHANCE if self.sets.allowances.scatters else 0

    def next_step(self, state: RunState, phase: Phase) -> events.Step | None:
        """The next step of the first set that is not closed; None if all are."""
        for point in range(1, self.point_count + 1):
            key = SetKey(phase=phase, point=point)
            if not state.set(key).closed and not self._is_left(state, key):
                return events.Locate() if state.position_unknown else self._in_set(state, key)
        return None

    def way_back(self, state: RunState, key: SetKey) -> events.Step:
        """The next move to the reference of a set; raises ``HexacellError`` if no safe path leads there."""
        # By the set's own moves, each of which was checked when it was chosen.
        is_in_order = not state.off_plan and (state.at_pose is None or state.at_pose[0] == key)
        return reference_move(state, key) if is_in_order else self._to_reference(state, key)

    def _poses(self, state: RunState, key: SetKey) -> tuple[tuple[SixNumbers, ...], int]:
        """The poses of a set, and how many of them were chosen as one list, in this order."""
        if key.phase is Phase.CONFIRM and state.confirmation is not None:
            poses = state.confirmation.poses[key.point - 1]
            return poses, len(poses)
        assert state.identified is not None  # noqa: S101 - its poses are held out of an identification
        common = state.identified.held_out[key.point - 1]
        if key.phase is Phase.BEFORE or not state.identified.held_out_after:
            return common, len(common)
        return common + state.identified.held_out_after[key.point - 1], len(common)

    def _is_left(self, state: RunState, key: SetKey) -> bool:
        """Whether a point cannot be measured: it has no poses, or the controller refuses its reference."""
        poses, common = self._poses(state, key)
        return not common or (not state.set(key).samples and not state.refused.allows(poses[0]))

    def _in_set(self, state: RunState, key: SetKey) -> events.Step:
        measured = state.set(key)
        require_zero(state, key)
        if measured.rejections and key.phase.has_new_geometry:
            if step := self._after_rejection(state, key):
                return step
        elif measured.rejections > self._by_chance:
            raise TravelError(f"{key}: the ball left the gauges' travel at a held-out pose")
        if step := self.sets.due_first(state, key, self.sets.ball_at_reference(state, key)):
            return step
        if (orientation := self._next_orientation(state, key)) is not None:
            return self.sets.at_pose(state, key, orientation) or self._to_pose(state, key, orientation)
        if step := self.sets.at_reference(state, key):
            return step
        # The poses were chosen with a safe straight line back from each of them.
        return self.way_back(state, key)

    def _next_orientation(self, state: RunState, key: SetKey) -> int | None:
        """The lowest one without a record that the controller does not refuse; None if there is none."""
        taken = {sample.orientation for sample in state.set(key).samples}
        poses, _ = self._poses(state, key)
        waiting = (number for number in range(1, len(poses) + 1) if number not in taken)
        return next((number for number in waiting if state.refused.allows(poses[number - 1])), None)

    def _to_pose(self, state: RunState, key: SetKey, orientation: int) -> events.Move:
        poses, common = self._poses(state, key)
        move = events.Move(at=key, orientation=orientation, pose=poses[orientation - 1])
        if orientation == 1:
            return self.sets.towards(state, move)
        # Each list of poses was chosen with safe lines from one to the next, replacements apart.
        replacements = {new for refused in state.excluded for _, new in refused.replacements}
        is_as_chosen = not replacements & {move.pose, state.target}
        if is_as_chosen and state.at_pose == (key, orientation - 1) and orientation != common + 1:
            return move
        return self.sets.towards(state, move, self.sets.ball_at_reference(state, key))

    def _after_rejection(self, state: RunState, key: SetKey) -> events.Step | None:
        """What follows when the ball has left the travel with the new geometry; None if its pose is next.

        A reading that could not be taken is no verdict: a gauge may have slipped. If the reference is as it
        was, the pose is taken again, and the second time, or beyond chance, it is a verdict.
        """
        measured = state.set(key)
        if measured.rejections > 1 + self._by_chance:
            back = None if measured.reference_unverified else self._back(state, key)
            return back or events.Judge()
        if not measured.reference_unverified:
            return None
        try:
            return self.sets.at_or_to_reference(state, key, self.sets.ball_at_reference(state, key))
        except LimitError:
            return events.Judge()

    def _back(self, state: RunState, key: SetKey) -> events.Move | None:
        """The move to the reference after the ball has left the travel; None there, or without a safe path.

        The verdict is certain, and the old config is to be restored. Far from level, the joint variables
        may belong to no pose of the old geometry. One attempt is made.
        """
        measured = state.set(key)
        if not measured.samples or measured.rejections > 2 + self._by_chance or state.at_pose == (key, 1):
            return None
        try:
            return self._to_reference(state, key)
        except LimitError:
            return None

    def _to_reference(self, state: RunState, key: SetKey) -> events.Move:
        return self.sets.to_reference(state, key, self.sets.ball_at_reference(state, key))
