"""The steps that measure the points for the identification, as the plan of the campaign decides."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.campaign.decisions import FinishPoint, MeasurePose, StartPoint
from hexacell.campaign.planner import Plan
from hexacell.errors import HexacellError
from hexacell.kinematics.rotations import Array
from procedures.calibration.calibration import campaign_state
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
from procedures.steps.close import CloseSet
from procedures.steps.lend import Lend
from procedures.steps.locate import Locate
from procedures.steps.move import Move
from procedures.steps.registry import Step
from procedures.workflow.noise import NoiseSteps
from procedures.workflow.sets import Known, SetSteps, move_to_chosen, require_zero
from procedures.workflow.trial import TrialSteps


@dataclass(frozen=True, eq=False)
class IdentificationSteps:
    """Decides on the steps that measure the points of a plan."""

    plan: Plan
    sets: SetSteps
    noise: NoiseSteps
    trials: TrialSteps

    def next_step(self, state: RunState) -> Step | None:
        """The next step; None if nothing more is to be measured."""
        key = open_set(state)
        if key is not None and (step := self._in_set(state, key)):
            return step
        match self.plan.decide(campaign_state(state, key)):
            case StartPoint() as start:
                return self._start_point(state, start)
            case MeasurePose() as pose:
                return move_to_chosen(state, pose)
            case FinishPoint() as finish:
                return self._finish_point(state, finish)
            case _:
                return None

    def _in_set(self, state: RunState, key: SetKey) -> Step | None:
        """What an open set needs before a new pose is chosen for it."""
        measured = state.set(key)
        if state.position_unknown:
            return Locate()
        require_zero(state, key)
        if measured.reference_unverified:
            return self._at_or_to_reference(state, key)
        if trial := self.trials.next_step(state, key, self._ball(state, key)):
            return trial
        measuring_noise = self.noise.next_step(state, key, self._known(state, key))
        # With several records to be taken again, one is, before the robot moves to the next of them.
        orientation, pose = measured.again[0] if measured.again else (None, None)
        if step := measuring_noise or self.sets.at_pose(state, key, orientation):
            return step
        if orientation is None or pose is None:
            return None
        move = Move(at=key, orientation=orientation, pose=pose)
        return self.sets.paths.towards(state, move, self._ball(state, key))

    def _start_point(self, state: RunState, start: StartPoint) -> Step:
        if self._applies_provisional(state):
            return Lend()
        at = SetKey(phase=Phase.IDENTIFY, point=start.point)
        move = Move(at=at, orientation=1, pose=start.pose.as_tuple())
        return Locate() if state.position_unknown else self.sets.paths.towards(state, move)

    def _applies_provisional(self, state: RunState) -> bool:
        """Whether the controller gets a provisional geometry now, between two points."""
        is_allowed = self.plan.settings.identification.provisional and not state.provisional_active
        if not is_allowed or not any(measured.closed for measured in state.sets.values()):
            return False
        return self.plan.allows_provisional(campaign_state(state, None))

    def _finish_point(self, state: RunState, finish: FinishPoint) -> Step:
        key = SetKey(phase=Phase.IDENTIFY, point=finish.point)
        if step := self.sets.at_reference(state, key):
            is_short = len(state.set(key).samples) < self.plan.records_at(finish.point)
            is_last = isinstance(step, CloseSet) and is_short
            return step.model_copy(update={"reason": finish.reason}) if is_last else step
        # Also at a waypoint of the path back: a new plan could return to where the robot came from.
        back = self.sets.paths.back(state, key, self._known(state, key))
        return back or self._at_or_to_reference(state, key)

    def _at_or_to_reference(self, state: RunState, key: SetKey) -> Step:
        step = self.sets.at_reference(state, key)
        return step or self.sets.to_reference(state, key, self._ball(state, key))

    def way_back(self, state: RunState, key: SetKey) -> Step:
        """The next move to the reference of a set in which the robot is.

        Raises:
            HexacellError: no safe path leads there.
        """
        return self.sets.way_back(state, key, self._known(state, key))

    def _ball(self, state: RunState, key: SetKey) -> Array | None:
        """Where the ball was when the set's gauges were zeroed (3,), mm, if the records determine it."""
        known = self._known(state, key)
        return None if known is None else known[1].reference

    def _known(self, state: RunState, key: SetKey) -> Known | None:
        try:
            return self._estimated(state, key)
        except HexacellError:
            return None

    def _estimated(self, state: RunState, key: SetKey) -> Known:
        """The belief by now and the gauges' zero under it; raises ``HexacellError`` if there is none."""
        estimate = self.plan.estimate(campaign_state(state, key))
        belief = estimate.belief.zeroed_at(state.zero_shown(key))
        return belief, estimate.gauge_zero(key.point)


def open_set(state: RunState) -> SetKey | None:
    """The set of the identification that is being measured."""
    visited = [] if state.at_pose is None else [state.at_pose[0]]
    for key in [*state.open_sets, *visited]:
        if key.phase is Phase.IDENTIFY and not state.set(key).closed and not state.is_left(key):
            return key
    return None
