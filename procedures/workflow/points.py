"""The steps that measure the points for the identification, as the plan of the campaign decides.

The noise is measured at the first reference: read at rest, leave and come back. As long as little is known
of the robot it leaves for pilot poses, which steer the choice of the others
(:mod:`hexacell.campaign.pilots`), and else for level ones beside the reference.
"""

from dataclasses import dataclass

import numpy as np

from hexacell.campaign.decisions import FinishPoint, MeasurePose, StartPoint
from hexacell.campaign.pilots import FIRST_PILOT
from hexacell.campaign.planner import Plan
from hexacell.errors import HexacellError
from hexacell.noise.noise_assessment import visits_agree
from procedures.calibration.calibration import campaign_state
from procedures.calibration.repeatability import noise_readings
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
from procedures.steps import events
from procedures.workflow.sets import Known, SetSteps, beside, move_to_chosen, reference_pose, require_zero

DISTANCE_SHARE = 0.3
"""How far the robot leaves the reference, level as it is, as a share of the gauges' travel."""


@dataclass(frozen=True, eq=False)
class NoiseSteps:
    """Decides on the steps of the sets of a plan's robot."""

    plan: Plan
    sets: SetSteps

    def next_step(self, state: RunState, key: SetKey, known: Known | None) -> events.Step | None:
        """The next step at the open set; None if the noise is measured, or not to be.

        ``known`` is the robot, and where the ball was when the gauges were zeroed, if that is known.
        """
        measured = state.set(key)
        wanted = self.plan.settings.noise
        is_asked = wanted.standstill_readings or wanted.revisits
        if state.noise is not None or not is_asked or len(measured.samples) != 1:
            return None
        if state.at_pose != (key, 1):
            return self._away(state, key) or self.sets.way_back(state, key, known)
        if measured.has_left:
            return events.Repeat(at=key)
        if wanted.standstill_readings and measured.standstill is None:
            return events.Standstill(at=key)
        return self._leave(state, key, known) or events.AssessNoise()

    def _away(self, state: RunState, key: SetKey) -> events.Step | None:
        """What is left to do before the robot returns to the reference; None if nothing is."""
        measured = state.set(key)
        if measured.piloted == self.plan.pilots_per_departure or not measured.has_left:
            return None
        orientation = FIRST_PILOT + len(measured.pilots)
        if state.at_pose == (key, orientation) and state.target is not None:
            return events.Pilot(at=key, orientation=orientation, pose=state.target)
        return self._to_pilot(state, key)

    def _to_pilot(self, state: RunState, key: SetKey) -> events.Move | None:
        """The next move to the next pilot pose; None if there is none, or the visits do not repeat.

        A robot that shows other places each time it is at one is not known by what it shows.
        """
        visits = noise_readings(state.set(key), self.plan.settings.encoders, self.sets.allowances)
        if not visits_agree(self.plan.cautious, visits):
            return None
        pilot = self.plan.pilot_pose(campaign_state(state, key))
        return None if pilot is None else move_to_chosen(state, pilot)

    def _leave(self, state: RunState, key: SetKey, known: Known | None) -> events.Move | None:
        """The move away from the reference before its next visit; None after the last one."""
        done = len(state.set(key).visits)
        if done >= self.plan.settings.noise.revisits:
            return None
        if pilot := self._to_pilot(state, key):
            return pilot
        reference = reference_pose(state, key)
        drawn = self.sets.robot.belief().zeroed_at(state.zero_shown(key))
        # What records of a robot that scatters seem to show may leave no way clear that is one as drawn.
        beliefs = [] if known is None else [(known[0], known[1].reference)]
        distance = DISTANCE_SHARE * self.sets.robot.limits.room.smallest_mm
        # On all sides of the reference, each pose followed by the opposite one.
        sides = distance * np.concatenate([[row, -row] for row in np.eye(3)])
        poses = [beside(reference, (x, y, z)) for x, y, z in sides.tolist()]
        for belief, ball in (*beliefs, (drawn, None)):
            clear = [pose for pose in poses if self.sets.is_clear_both_ways(belief, reference, pose, ball)]
            if clear:
                return events.Move(at=key, orientation=0, pose=clear[done % len(clear)])
        return None


@dataclass(frozen=True, eq=False)
class IdentificationSteps:
    """Decides on the steps that measure the points of a plan."""

    plan: Plan
    sets: SetSteps
    noise: NoiseSteps

    def next_step(self, state: RunState) -> events.Step | None:
        """The next step; None if nothing more is to be measured."""
        key = open_set(state)
        if key is not None and (step := self._in_set(state, key)):
            return step
        match self.plan.decide(campaign_state(state, key)):
            case StartPoint() as start:
                if self._applies_provisional(state):
                    return events.Lend()
                at = SetKey(phase=Phase.IDENTIFY, point=start.point)
                move = events.Move(at=at, orientation=1, pose=start.pose.as_tuple())
                return events.Locate() if state.position_unknown else self.sets.towards(state, move)
            case MeasurePose() as pose:
                return move_to_chosen(state, pose)
            case FinishPoint() as finish:
                return self._finish_point(state, finish)
            case _:
                return None

    def _in_set(self, state: RunState, key: SetKey) -> events.Step | None:
        """What an open set needs before a new pose is chosen for it."""
        measured = state.set(key)
        if state.position_unknown:
            return events.Locate()
        require_zero(state, key)
        known = self._known(state, key)
        ball = None if known is None else known[1].reference
        if step := self.sets.due_first(state, key, ball):
            return step
        measuring_noise = self.noise.next_step(state, key, known)
        # With several records to be taken again, one is, before the robot moves to the next of them.
        orientation, pose = measured.again[0] if measured.again else (None, None)
        if step := measuring_noise or self.sets.at_pose(state, key, orientation):
            return step
        if orientation is None or pose is None:
            return None
        return self.sets.towards(state, events.Move(at=key, orientation=orientation, pose=pose), ball)

    def _applies_provisional(self, state: RunState) -> bool:
        """Whether the controller gets a provisional geometry now, between two points."""
        is_allowed = self.plan.settings.identification.provisional and not state.provisional_active
        if not is_allowed or not any(measured.closed for measured in state.sets.values()):
            return False
        return self.plan.allows_provisional(campaign_state(state, None))

    def _finish_point(self, state: RunState, finish: FinishPoint) -> events.Step:
        key = SetKey(phase=Phase.IDENTIFY, point=finish.point)
        if step := self.sets.at_reference(state, key):
            is_short = len(state.set(key).samples) < self.plan.records_at(finish.point)
            is_last = isinstance(step, events.CloseSet) and is_short
            return step.model_copy(update={"reason": finish.reason}) if is_last else step
        # Also at a waypoint of the path back: a new plan could return to where the robot came from.
        return self.way_back(state, key)

    def way_back(self, state: RunState, key: SetKey) -> events.Step:
        """The next move to the reference of a set; raises ``HexacellError`` if no safe path leads there."""
        return self.sets.way_back(state, key, self._known(state, key))

    def _known(self, state: RunState, key: SetKey) -> Known | None:
        """The belief by now and the gauges' zero under it; None if there is no estimate."""
        try:
            estimate = self.plan.estimate(campaign_state(state, key))
            return estimate.belief.zeroed_at(state.zero_shown(key)), estimate.gauge_zero(key.point)
        except HexacellError:
            return None


def open_set(state: RunState) -> SetKey | None:
    """The set of the identification that is being measured."""
    visited = [] if state.at_pose is None else [state.at_pose[0]]
    for key in [*state.open_sets, *visited]:
        if key.phase is Phase.IDENTIFY and not state.set(key).closed and not state.is_left(key):
            return key
    return None
