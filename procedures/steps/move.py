"""Move: the robot goes to a pose, unless the controller refuses it."""

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from drivers.errors import PoseRefused
from hexacell.campaign.decisions import Forecast
from hexacell.campaign.time_model import TimeKind
from hexacell.cell.fields import Frozen
from hexacell.cell.model import CellSettings
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.kinematics.pose import Pose
from hexacell.lengths import from_to
from procedures.calibration.held_out_poses import held_out_replacements
from procedures.resources.run_resources import RunResources
from procedures.run.cancellation import in_thread
from procedures.run.keys import ArrivalDirections, Phase, SetKey, SixNumbers, ThreeNumbers
from procedures.run.state import RunState
from procedures.run.trips import Guard, GuardTripped, WatchedSet
from procedures.steps.base import BaseEvent, EventAtPose, StepAtPose
from procedures.steps.identify import Identified
from procedures.steps.place import are_fixed
from procedures.steps.sample import RecordRejected

OFF_THE_PLATE = {Guard.GAUGE_END, Guard.PLATE}
"""Guards that trip on the pose alone, while all devices work."""

STUCK_GAUGE_SIGMAS = 5.0
"""An expected displacement is reduced by so many standard deviations before a gauge counts as stuck."""


class Arrived(EventAtPose):
    """A move has ended at its pose; ``directions`` say from which side each joint arrived.

    ``straight``: the cell file wants one direction, and no waypoint before the pose was possible.
    """

    kind: Literal["arrived"] = "arrived"
    directions: ArrivalDirections = ()
    straight: bool = False

    def applied_to(self, state: RunState) -> RunState:
        """The gauges of all other open sets may be carried away now."""
        is_waypoint = self.orientation == 0
        if self.orientation != 1 and self.at in state.sets:
            state = state.with_changed_set(self.at, has_left=True)
        arrived = replace(
            state,
            at_pose=None if is_waypoint else (self.at, self.orientation),
            off_plan=is_waypoint,
            target=self.pose,
            directions=self.directions,
            path_from_reference=self._path(state),
            position_unknown=False,
            is_in_estop=False,
        )
        return arrived.unverified(but=self.at)

    def text(self, state: RunState) -> str | None:
        if not self.straight or self.orientation == 0:
            return None
        return f"{self.at.pose_name(self.orientation)}: reached straight, no waypoint before it is possible"

    def _path(self, state: RunState) -> tuple[tuple[int, SixNumbers], ...]:
        """The path from the reference without loops; empty if the robot did not start from its end."""
        poses = [pose for _, pose in state.path_from_reference]
        if self.orientation == 1:
            return ((1, self.pose),)
        if self.pose in poses:
            return state.path_from_reference[: poses.index(self.pose) + 1]
        is_at_its_end = not state.position_unknown and bool(poses) and state.target == poses[-1]
        return (*state.path_from_reference, (self.orientation, self.pose)) if is_at_its_end else ()


class PoseExcluded(EventAtPose):
    """The controller refused a pose and did not move; it is not commanded again in this run.

    ``axis`` is the axis beyond whose limit it is, the highest or the lowest; then no pose is commanded that
    is as far out. Without it the pose alone is left out. ``replacements`` are held-out poses that cannot be
    commanded now, each with the one that takes its place. ``has_left``: the robot was at a waypoint before
    the pose by then.
    """

    kind: Literal["excluded"] = "excluded"
    reason: str
    axis: Literal["x", "y", "z", "a", "b", "c"] | None = None
    is_highest: bool = True
    replacements: tuple[tuple[SixNumbers, SixNumbers], ...] = ()
    has_left: bool = False

    def applied_to(self, state: RunState) -> RunState:
        """The robot is where it was; a record that was to be taken again at the pose is chosen anew."""
        state = state.without_position() if self.has_left else state
        left = replace(state, excluded=(*state.excluded, self), identified=self._with_replacements(state))
        if self.at not in state.sets:
            return left
        again = tuple(pair for pair in state.set(self.at).again if pair[1] != self.pose)
        return left.with_changed_set(self.at, again=again)

    def _with_replacements(self, state: RunState) -> Identified | None:
        """The identification with other held-out poses in the place of those that cannot be commanded."""
        found, place = state.identified, dict(self.replacements)
        if found is None or not place:
            return found
        lists = {
            name: tuple(tuple(place.get(pose, pose) for pose in poses) for poses in getattr(found, name))
            for name in ("held_out", "held_out_after")
        }
        return found.model_copy(update=lists)

    def text(self, state: RunState) -> str:
        if self.orientation == 1:
            what = "its reference is refused, the point is left out"
        else:
            what = "the controller refuses this pose, which is not commanded again"
        return f"{self.at.pose_name(self.orientation)}: {what}: {self.reason}"


class Expectation(Frozen):
    """What the gauges should show (mm, base x y z), one sigma, and what is learnt (nat)."""

    deviation_mm: ThreeNumbers
    sigma_mm: ThreeNumbers
    gain: float
    forecast: Forecast | None = None


class Move(StepAtPose):
    """Send the robot to a pose. Orientation 0 is a waypoint, at which nothing is measured.

    With ``from_elsewhere`` it comes from where the set's gauges are not, as to a set's first reference.
    From a ``waypoint`` every joint arrives in the direction that the cell file wants; where it wants one
    and no waypoint is possible, the move is ``straight``.
    """

    kind: Literal["move"] = "move"
    expected: Expectation | None = None
    from_elsewhere: bool = False
    waypoint: SixNumbers | None = None
    straight: bool = False

    outcomes: ClassVar = (Arrived, PoseExcluded)
    takes: ClassVar[TimeKind] = TimeKind.MOVING

    @property
    def target(self) -> Pose:
        """Where to: the pose as the controller takes it."""
        return Pose(*self.pose)

    def activity(self) -> str:
        forecast = self.expected and self.expected.forecast
        predicted = f": {from_to(forecast.now_mm, forecast.end_mm)}" if forecast else ""
        return f"{self.at.pose_name(self.orientation)}{predicted}"

    async def perform(self, run: RunResources, state: RunState) -> BaseEvent:
        """Move under guards; with a new geometry a ball that leaves its plate is a rejected record."""
        await run.require_departure(state)
        here = Pose(*state.target) if state.target else (await run.locate()).pose
        way = [here, *([] if self.waypoint is None else [Pose(*self.waypoint)]), self.target]
        at_gauges = gauges_are_at_ball(run.settings, self.at, state)
        try:
            await run.move(way, self._watched(state), at_gauges=at_gauges)
        except PoseRefused as refusal:
            return await self._refused(run, state, refusal)
        except GuardTripped as tripped:
            measured = state.set(self.at)
            is_there = not measured.reference_unverified or measured.rejections > 0
            is_off_plate = tripped.trip.guard in OFF_THE_PLATE
            scatters = run.calibration.known(state).allowances.scatters
            if not (self.at.phase.has_new_geometry or scatters) or not is_off_plate or not is_there:
                raise
            # A machine that does not repeat may leave the plate by chance: another pose is taken. Where a
            # new geometry takes the ball off its plate, the second time is a verdict.
            run.guards.supervisor.clear()
            reason = str(tripped)
            return RecordRejected(at=self.at, orientation=self.orientation, reason=reason, on_the_way=True)
        return Arrived(
            at=self.at,
            orientation=self.orientation,
            pose=self.pose,
            directions=run.arrival_directions(state, way),
            straight=self.straight,
        )

    def _watched(self, state: RunState) -> WatchedSet:
        """What the gauges of the set must show on the way."""
        samples = state.set(self.at).samples
        zero_mm = state.zero_shown(self.at) if samples and not self.from_elsewhere else None
        moved_mm = None
        if self.expected is not None and state.at_pose == (self.at, len(samples)):
            change = np.subtract(self.expected.deviation_mm, samples[-1].deviation_mm)
            sure = np.abs(change) - STUCK_GAUGE_SIGMAS * np.array(self.expected.sigma_mm)
            moved_mm = tuple(np.copysign(np.maximum(0.0, sure), change).tolist())
        return WatchedSet(zero_mm, moved_mm)

    async def _refused(self, run: RunResources, state: RunState, refusal: PoseRefused) -> PoseExcluded:
        """A refusal of the pose is no failure: the robot is where it was, and others may be possible.

        Where it still is, its waypoint was refused, without which the pose is tried straight.
        """
        has_stayed = await run.is_at(state.target)
        has_left = not has_stayed and self.waypoint is not None and await run.is_at(self.waypoint)
        refusals = sum(one.at == self.at for one in state.excluded)
        if refusals >= run.most_refusals or not (has_stayed or has_left):
            raise refusal
        of_waypoint = self.waypoint if has_stayed else None
        excluded = PoseExcluded(
            at=self.at,
            orientation=0 if of_waypoint else self.orientation,
            pose=of_waypoint or self.pose,
            reason=refusal.reason,
            axis=refusal.axis,
            is_highest=refusal.is_highest,
            has_left=has_left,
        )
        return await in_thread(_with_replacements, excluded, run, state)


def _with_replacements(refusal: PoseExcluded, run: RunResources, state: RunState) -> PoseExcluded:
    """A refusal at a held-out point with others for the held-out poses that it leaves out."""
    if state.identified is None or refusal.at.phase not in {Phase.BEFORE, Phase.AFTER}:
        return refusal
    after = refusal.applied_to(state)
    known = run.calibration.known(after)
    try:
        identified = identify(known.robot_of(after).problem(after.measurements()))
        pairs = tuple(held_out_replacements(known, identified, after))
    except HexacellError:  # then those that are left are measured
        return refusal
    return refusal.model_copy(update={"replacements": pairs})


def gauges_are_at_ball(settings: CellSettings, at: SetKey, state: RunState) -> bool:
    """Whether a move to a set begins or ends with gauges at the ball.

    Where they are fixed they stand at every point. Placed by hand, they stand around the ball from then
    until the robot has left their point, and at any open set that it may be in.
    """
    left = [] if state.at_pose is None else [state.at_pose[0]]
    return are_fixed(settings, at) or any(state.set(key).placed for key in (at, *left, *state.open_sets))
