"""What to do next: the whole procedure as a decision on where the run stands.

The points are measured as the plan has it (:mod:`hexacell.campaign.planner`); then the geometry is
identified and the held-out points are visited; the geometry is written back, and the held-out
points are visited again. Nothing here talks to hardware or disk, so the same decisions serve a run,
its resumption and its replay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

from hexacell.acceptance.validation import Verdict
from hexacell.campaign.decisions import CampaignState, FinishPoint, MeasurePose, StartPoint
from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_list import PoseList
from hexacell.cell.model import CellSettings
from hexacell.errors import HexacellError, LimitError
from hexacell.experiment_design import candidates
from hexacell.experiment_design.gauge_zero import GaugeZero
from hexacell.experiment_design.validation_poses import select_validation_poses
from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot_model import Robot
from procedures.calibration.path_planning import RunPathPlanner
from procedures.run import events
from procedures.run.events import RecordTaken
from procedures.run.state import RunState, SetState, record
from procedures.run.steps import (
    CloseSet,
    Compute,
    Expectation,
    Locate,
    Move,
    Phase,
    Place,
    Revisit,
    Sample,
    SetKey,
    SixNumbers,
    Step,
)

CANDIDATES = 1024
HELD_OUT_CANDIDATES = 2048


class TravelError(LimitError):
    """The gauges' plungers are at an end of their travel where they must not be."""


class Mode(StrEnum):
    """What a run is for."""

    OPTIMISE = "optimise"
    CHECK = "check"


def expected_records(settings: CellSettings, mode: Mode, listed: PoseList | None = None) -> int:
    """How many times a whole run waits for settled readings at most, closings of sets included."""
    plan, held_out = settings.identification, settings.verification
    verification = len(held_out.points) * (held_out.orientations + 1)
    if mode is Mode.CHECK:
        return verification
    records = len(plan.points) * plan.orientations if listed is None else len(listed)
    return min(records, plan.budget_records or records) + len(plan.points) + 2 * verification


@dataclass(frozen=True, eq=False)
class Calibration:
    """The procedure of one cell; ``listed`` are the poses that it names, where it does."""

    settings: CellSettings
    robot: Robot
    mode: Mode
    listed: PoseList | None = None

    @cached_property
    def plan(self) -> Plan:
        """What is measured to identify the geometry."""
        return Plan(self.settings, self.robot, self.listed, CANDIDATES)

    def next_step(self, state: RunState) -> Step | None:
        """The step to do where the run stands; nothing when it is over."""
        if state.ended is not None:
            return None
        if state.config_write_pending:
            return Compute(kind="take back")
        if state.lent is not None and not self.robot.provisional:
            return self._with_lent(state.lent, lending=state.lending).next_step(state)
        return self._checking(state) if self.mode is Mode.CHECK else self._optimising(state)

    def _checking(self, state: RunState) -> Step | None:
        return self._measuring(state, Phase.BEFORE) or (None if state.judged else Compute(kind="judge"))

    def _optimising(self, state: RunState) -> Step | None:
        if state.identified is None:
            return self._planned(state) or Compute(kind="take back" if state.lending else "identify")
        return self._measuring(state, Phase.BEFORE) or self._writing_back(state)

    def identification(self, state: RunState) -> Identification:
        """The geometry that the run's records give.

        Raises:
            IdentifiabilityError: they cannot give one.
        """
        return identify(self.robot_of(state).problem(state.measurements()))

    def robot_of(self, state: RunState) -> Robot:
        """The robot with all geometries that commanded the run's records."""
        if state.lent is None:
            return self.robot
        return self._with_lent(state.lent, lending=state.lending).robot

    def to_lend(self, state: RunState) -> Geometry:
        """The estimate by now, or what was lent before an interruption: its poses are to be visited again.

        Raises:
            HexacellError: the records so far give none.
        """
        if state.lent is not None:
            return geometry_of(state.lent)
        return self.plan.estimate(self._situation(state, None)).belief.estimate

    def _with_lent(self, lent: events.ProvisionalApplied, *, lending: bool) -> Calibration:
        if lending not in self._lent:
            robot = replace(self.robot, provisional=(geometry_of(lent),), uses_provisional=lending)
            self._lent[lending] = replace(self, robot=robot)
        return self._lent[lending]

    @cached_property
    def _lent(self) -> dict[bool, Calibration]:
        """This procedure with a lent geometry, which is one for the whole run."""
        return {}

    def held_out_poses(self, identified: Identification | None) -> tuple[tuple[SixNumbers, ...], ...]:
        """Poses at each held-out point, in the controller's frames.

        Raises:
            LimitError: a point has too few that keep the ball inside the travel.
        """
        verification = self.settings.verification
        belief = self.robot.belief(identified)
        used = None if identified is None else identified.poses.rotations
        turns = candidates.orientations(HELD_OUT_CANDIDATES, belief.limits.tilt, verification.seed)
        chosen = []
        for point in verification.points:
            position = self.robot.from_commands([Pose(*point)]).positions[0]
            poses = select_validation_poses(belief, position, verification.orientations, turns, used)
            chosen.append(
                tuple(self.robot.to_command(poses.pose(row)).as_tuple() for row in range(len(poses)))
            )
        return tuple(chosen)

    def _writing_back(self, state: RunState) -> Step | None:
        if state.proposed is None:
            return Compute(kind="propose")
        if state.judged is None:
            if state.rolling_back:
                return Compute(kind="roll back")
            if state.committed is None:
                return Compute(kind="commit")
            return self._measuring(state, Phase.AFTER) or Compute(kind="judge")
        if state.judged.verdict is not Verdict.PASS and not state.rolled_back:
            return Compute(kind="roll back")
        return None

    def _planned(self, state: RunState) -> Step | None:
        """The next step of identification; none when nothing more is to be measured."""
        key = open_set(state)
        if key is not None and (step := self._in_set(state, key)):
            return step
        match self.plan.decide(self._situation(state, key)):
            case StartPoint() as opening:
                return self._opening(state, opening)
            case MeasurePose() as visit:
                return self._visiting(state, visit)
            case FinishPoint(point=point):
                return self._closing(state, SetKey(phase=Phase.IDENTIFY, point=point))
            case _:
                return None

    def _opening(self, state: RunState, opening: StartPoint) -> Step:
        """On to a point, by a checked way; before that the controller may be lent a geometry."""
        if self._lends(state):
            return Compute(kind="lend")
        at = SetKey(phase=Phase.IDENTIFY, point=opening.point)
        move = Move(at=at, orientation=1, pose=opening.pose.as_tuple())
        return Locate() if state.position_unknown else self.ways.towards(state, move)

    def _visiting(self, state: RunState, visit: MeasurePose) -> Move:
        """To the pose chosen, or to the first of those that lie on the way."""
        at = SetKey(phase=Phase.IDENTIFY, point=visit.point)
        if visit.via:
            pose = visit.via[0].as_tuple()
            by_pose = {sample.pose: sample.orientation for sample in state.set(at).samples}
            return Move(at=at, orientation=by_pose.get(pose, 0), pose=pose)
        return Move(
            at=at,
            orientation=state.set(at).next_orientation,
            pose=visit.pose.as_tuple(),
            expected=_expectation(visit),
        )

    def _lends(self, state: RunState) -> bool:
        """Whether the controller is to be lent a geometry now, between two points."""
        allowed = self.settings.identification.provisional and not state.lending
        if not allowed or not any(measured.closed for measured in state.sets.values()):
            return False
        return self.plan.allows_provisional(self._situation(state, None))

    def _in_set(self, state: RunState, key: SetKey) -> Step | None:
        """What is to be done in a set that is begun before anything new is planned there."""
        measured = state.set(key)
        if state.position_unknown:
            return Locate()
        _require_zero(key, measured)
        if measured.reference_unverified:
            return self._returning(state, key)
        if step := self._standing_move(state, key):
            return step
        if not measured.again:
            return None
        orientation, pose = measured.again[0]
        move = Move(at=key, orientation=orientation, pose=pose)
        return self.ways.towards(state, move, self._reference(state, key))

    def _situation(self, state: RunState, key: SetKey | None) -> CampaignState:
        """Where the plan stands. Records are in the order of their sets, which are never reordered."""
        sets = {at: measured for at, measured in state.sets.items() if at.phase is Phase.IDENTIFY}
        records = tuple(record(sample) for measured in sets.values() for sample in measured.samples)
        return CampaignState(
            measurements=MeasurementSet(records),
            point=None if key is None else key.point,
            done=frozenset(at.point for at, measured in sets.items() if measured.closed),
            present=None if key is None else self._present(state, state.set(key).samples),
            refusals=0 if key is None else state.set(key).refusals,
        )

    def _measuring(self, state: RunState, phase: Phase) -> Step | None:
        """The next step of the first set of held-out poses that is not closed."""
        for point in range(1, len(self.settings.verification.points) + 1):
            key = SetKey(phase=phase, point=point)
            if not state.set(key).closed:
                return Locate() if state.position_unknown else self._next_held_out(state, key)
        return None

    def _next_held_out(self, state: RunState, key: SetKey) -> Step:
        measured = state.set(key)
        if measured.refusals and key.phase is Phase.AFTER:
            return Compute(kind="judge")
        _require_zero(key, measured)
        if measured.refusals:
            raise TravelError(f"{key}: the ball left the gauges' travel at a held-out pose")
        if measured.reference_unverified:
            return self._returning(state, key)
        if len(measured.samples) < self.settings.verification.orientations:
            return self._standing_move(state, key) or self._held_out_move(state, key, measured)
        return self._closing(state, key)

    def _standing_move(self, state: RunState, key: SetKey) -> Step | None:
        """What to do at the pose the robot was just sent to: place the gauges, or sample."""
        orientation = state.set(key).next_orientation
        if state.standing != (key, orientation) or state.target is None:
            return None
        if orientation == 1 and not state.set(key).placed:
            return Place(at=key, pose=state.target)
        return Sample(at=key, orientation=orientation, pose=state.target)

    def _closing(self, state: RunState, key: SetKey) -> Step:
        if state.standing == (key, 1):
            return CloseSet(at=key)
        if key.phase is not Phase.IDENTIFY:  # held-out poses were chosen with a safe way back
            home = Move(at=key, orientation=1, pose=self._pose(state, key, 1))
            return home if self.ways.is_in_order(state, key) else self._returning(state, key)
        # Also from a stop on the way back, where anything else might lead to where it came from.
        return self.ways.back(state, key, self._known_or_nothing(state, key)) or self._returning(state, key)

    def _known_or_nothing(self, state: RunState, key: SetKey) -> tuple[RobotBelief, GaugeZero] | None:
        try:
            return self._known(state, key)
        except HexacellError:
            return None

    def _returning(self, state: RunState, key: SetKey) -> Step:
        """To the set's reference by a checked way, and see there whether the gauges kept their zero."""
        if state.standing == (key, 1):
            return Revisit(at=key) if state.set(key).reference_unverified else CloseSet(at=key)
        home = Move(at=key, orientation=1, pose=self._pose(state, key, 1))
        return self.ways.towards(state, home, self._reference(state, key))

    def _pose(self, state: RunState, key: SetKey, orientation: int) -> SixNumbers:
        pose = state.set(key).pose(orientation)
        assert pose is not None  # noqa: S101 - asked for orientations that were measured only
        return pose

    def _reference(self, state: RunState, key: SetKey) -> Array | None:
        """Where the ball was when the set's gauges were zeroed (3,), mm, if the records can tell."""
        if key.phase is not Phase.IDENTIFY:
            return self.ways.ball_at(state, self._pose(state, key, 1))
        known = self._known_or_nothing(state, key)
        return None if known is None else known[1].reference

    @cached_property
    def ways(self) -> RunPathPlanner:
        """How to get from anywhere to a pose."""
        return RunPathPlanner(self.robot)

    @cached_property
    def _poses_to_check(self) -> tuple[tuple[SixNumbers, ...], ...]:
        """Held-out poses of a run that identifies nothing: what the drawing alone makes safe."""
        return self.held_out_poses(None)

    def _held_out_move(self, state: RunState, key: SetKey, measured: SetState) -> Move:
        poses = state.identified.held_out if state.identified else self._poses_to_check
        orientation = measured.next_orientation
        move = Move(at=key, orientation=orientation, pose=poses[key.point - 1][orientation - 1])
        if orientation == 1:
            return self.ways.towards(state, move)
        in_turn = state.standing == (key, orientation - 1)  # poses were chosen with safe ways between them
        return move if in_turn else self.ways.towards(state, move, self._reference(state, key))

    def _known(self, state: RunState, key: SetKey) -> tuple[RobotBelief, GaugeZero]:
        """The estimate by now, and where it says the ball was when the set's gauges were zeroed.

        Raises:
            LimitError: it cannot say so.
        """
        known = self.plan.estimate(self._situation(state, key))
        return known.belief, known.gauge_zero(key.point)

    def _present(self, state: RunState, samples: tuple[RecordTaken, ...]) -> Pose | None:
        """The pose that the robot holds, that of a refused record included."""
        if state.target is not None:
            return Pose(*state.target)
        return Pose(*samples[-1].pose) if samples else None

    def _held(self, pose: SixNumbers) -> PoseBatch:
        """A commanded pose in the convention's frames."""
        return self.robot.from_commands([Pose(*pose)])


def geometry_of(lent: events.ProvisionalApplied) -> Geometry:
    """What was lent, in the mechanism's frame convention."""
    return Geometry(lent.geometry.S, lent.geometry.B, lent.geometry.l)


def open_set(state: RunState) -> SetKey | None:
    """The set that identification is in the middle of."""
    begun = [key for key, measured in state.sets.items() if not measured.closed]
    standing = [] if state.standing is None else [state.standing[0]]
    for key in [*begun, *standing]:
        if key.phase is Phase.IDENTIFY and not state.set(key).closed:
            return key
    return None


def _require_zero(key: SetKey, measured: SetState) -> None:
    if not measured.samples and measured.refusals:
        raise TravelError(f"{key}: the gauges cannot be zeroed, they are at the end of their travel")


def _expectation(visit: MeasurePose) -> Expectation:
    return Expectation(
        deviation_mm=visit.deviation,
        sigma_mm=visit.sigma,
        gain=visit.gain,
        forecast=visit.forecast,
    )
