"""The steps that measure the points for the identification, as the plan of the campaign decides."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.campaign.decisions import CampaignState, FinishPoint, MeasurePose, StartPoint
from hexacell.campaign.planner import Plan
from hexacell.errors import HexacellError
from hexacell.experiment_design.predicted_records import GaugeZero
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from procedures.calibration.noise_steps import NoiseSteps
from procedures.calibration.set_steps import SetSteps, require_zero
from procedures.calibration.trial_steps import TrialSteps
from procedures.run.state import RunState, record
from procedures.run.steps import CloseSet, Compute, Expectation, Locate, Move, Phase, SetKey, Step


@dataclass(frozen=True, eq=False)
class IdentificationSteps:
    """Decides on the steps; ``provisional``: whether a provisional geometry may be applied meanwhile."""

    plan: Plan
    sets: SetSteps
    provisional: bool
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
                return _measure_pose(state, pose)
            case FinishPoint() as finish:
                return self._finish_point(state, finish)
            case _:
                return None

    def estimate(self, state: RunState) -> Geometry:
        """The geometry estimated from the records so far; raises ``HexacellError`` if they give none."""
        return self.plan.estimate(campaign_state(state, None)).belief.estimate

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
        measuring_noise = self.noise.next_step(state, key, self._ball(state, key))
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
            return Compute(kind="lend")
        at = SetKey(phase=Phase.IDENTIFY, point=start.point)
        move = Move(at=at, orientation=1, pose=start.pose.as_tuple())
        return Locate() if state.position_unknown else self.sets.paths.towards(state, move)

    def _applies_provisional(self, state: RunState) -> bool:
        """Whether the controller gets a provisional geometry now, between two points."""
        is_allowed = self.provisional and not state.provisional_active
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
        back = self.sets.paths.back(state, key, self._known(state, key))
        return back or self.sets.to_reference(state, key, self._ball(state, key))

    def _ball(self, state: RunState, key: SetKey) -> Array | None:
        """Where the ball was when the set's gauges were zeroed (3,), mm, if the records determine it."""
        known = self._known(state, key)
        return None if known is None else known[1].reference

    def _known(self, state: RunState, key: SetKey) -> tuple[RobotBelief, GaugeZero] | None:
        try:
            return self._estimated(state, key)
        except HexacellError:
            return None

    def _estimated(self, state: RunState, key: SetKey) -> tuple[RobotBelief, GaugeZero]:
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


def campaign_state(state: RunState, key: SetKey | None) -> CampaignState:
    """The run as the campaign knows it, with an open set or none.

    Records are in the order in which their sets were measured.
    """
    sets = {at: measured for at, measured in state.sets.items() if at.phase is Phase.IDENTIFY}
    records = tuple(record(sample) for measured in sets.values() for sample in measured.samples)
    return CampaignState(
        measurements=MeasurementSet(records),
        point=None if key is None else key.point,
        done=frozenset(at.point for at, measured in sets.items() if measured.closed) | _left_points(state),
        present=_present_pose(state, key),
        rejections=0 if key is None else state.set(key).rejections,
        zero_mm=None if key is None else state.zero_shown(key),
    )


def _left_points(state: RunState) -> frozenset[int]:
    """Points that cannot be measured, because the controller refuses their reference."""
    keys = {refused.at for refused in state.excluded if refused.at.phase is Phase.IDENTIFY}
    return frozenset(key.point for key in keys if state.is_left(key))


def _present_pose(state: RunState, key: SetKey | None) -> Pose | None:
    """The pose that the robot was commanded to last, that of a rejected record included.

    Between points none where it was brought by somebody: it can be brought elsewhere, too.
    """
    if state.target is not None and (key is not None or state.at_pose is not None):
        return Pose(*state.target)
    if key is None:
        return None
    samples = state.set(key).samples
    return Pose(*samples[-1].pose) if samples else None


def _measure_pose(state: RunState, chosen: MeasurePose) -> Move:
    """The move to the chosen pose, or to the first waypoint of its path."""
    at = SetKey(phase=Phase.IDENTIFY, point=chosen.point)
    if chosen.via:
        pose = chosen.via[0].as_tuple()
        by_pose = {sample.pose: sample.orientation for sample in state.set(at).samples}
        return Move(at=at, orientation=by_pose.get(pose, 0), pose=pose)
    return Move(
        at=at,
        orientation=state.set(at).next_orientation,
        pose=chosen.pose.as_tuple(),
        expected=Expectation(
            deviation_mm=chosen.deviation,
            sigma_mm=chosen.sigma,
            gain=chosen.gain,
            forecast=chosen.forecast,
        ),
    )
