"""The plan carried out on a robot that is known exactly: what would be measured, without hardware.

The machine moves as a real one does, along the controller's straight lines and on its own geometry,
so that the plan's care for travel and singularities is put to the test and not assumed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hexacell.campaign.decisions import CampaignState, Finished, FinishPoint, MeasurePose, StartPoint
from hexacell.campaign.planner import Plan, joints_of
from hexacell.cell.model import CellSettings
from hexacell.errors import LimitError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.motion.route_search import find_route
from hexacell.motion.waypoint_planner import PathPlanner
from hexacell.robot_model import Robot
from hexacell.virtual_robot.virtual_robot import StudiedMachine


@dataclass(eq=False)
class AdaptiveCampaign:
    """One campaign, from the first reference to the end of the plan.

    Attributes:
        lend: whether the controller is lent the estimate once the robot is known well enough.
        outside: records at which the ball left the travel; they are not taken.
        largest_mm: the largest deviation, of records taken or not.
        reason: why the plan ended.
    """

    settings: CellSettings
    robot: Robot
    truth: Geometry
    random: np.random.Generator
    lend: bool = False
    outside: int = 0
    largest_mm: float = 0.0
    reason: str = ""
    machine: StudiedMachine = field(init=False)
    state: CampaignState = field(init=False)

    def __post_init__(self) -> None:
        self.machine = StudiedMachine(self.robot, self.truth)
        self.state = CampaignState()
        self._plan = Plan(self.settings, self.robot, with_forecast=False)
        self._zero: Array = np.zeros(3)
        self._standing: Pose | None = None
        self._trail: list[Pose] = []

    @property
    def measurements(self) -> MeasurementSet:
        """The records taken so far."""
        return self.state.measurements

    def carry_out(self) -> None:
        """Measure all that the plan asks for.

        Raises:
            HexacellError: the robot cannot be calibrated so.
        """
        while self.step():
            pass

    def step(self) -> bool:
        """Do one thing; false at the end.

        Raises:
            HexacellError: it cannot be done.
        """
        match self._plan.decide(self.state):
            case StartPoint() as opening:
                self._open(opening)
            case MeasurePose() as visit:
                self._visit(visit)
            case FinishPoint(point=point):
                self._close(point)
            case Finished(reason=reason):
                self.reason = reason
                return False
        return True

    def _open(self, opening: StartPoint) -> None:
        if self._standing is not None:
            self._onward(opening.pose)
        self._go(opening.pose)
        self._trail = [opening.pose]
        self._zero = self.machine.ball
        self._take(opening.point, 1, opening.pose)

    def _visit(self, visit: MeasurePose) -> None:
        for pose in (*visit.via, visit.pose):
            self._go(pose)
        away = float(np.abs(self.machine.ball - self._zero).max())
        self.largest_mm = max(self.largest_mm, away)
        if away > self.robot.limits.gauge_travel_mm:
            self.outside += 1
            self.state = replace(self.state, present=visit.pose, refusals=self.state.refusals + 1)
        else:
            self._take(visit.point, visit.orientation, visit.pose)

    def _take(self, point: int, orientation: int, pose: Pose) -> None:
        noise = self.robot.noise
        joints = self.machine.joints + noise.encoder_mm * self.random.standard_normal(6)
        shown = self.machine.ball - self._zero + noise.gauge_mm * self.random.standard_normal(3)
        x, y, z = (float(value) for value in shown)
        record = Record(point, orientation, pose, joints_of(joints), (x, y, z))
        records = (*self.state.measurements.records, record)
        self.state = replace(self.state, measurements=MeasurementSet(records), point=point, present=pose)

    def _close(self, point: int) -> None:
        reference = self._plan.estimate(self.state).gauge_zero(point).reference
        self._back(reference)
        done = self.state.done | {point}
        self.state = CampaignState(self.state.measurements, done=done)
        if self.lend and not self.robot.uses_provisional and self._plan.allows_provisional(self.state):
            self._lend()

    def _lend(self) -> None:
        known = self._plan.estimate(self.state)
        geometry = known.belief.estimate
        self.machine.load(geometry)
        self._standing = self.robot.to_command(self.machine.believed)
        self.robot = replace(self.robot, provisional=(geometry,), uses_provisional=True)
        self._plan = Plan(self.settings, self.robot, with_forecast=False)

    def _onward(self, goal: Pose) -> None:
        """To another point by lines that the estimate finds clear, over untilted poses if need be."""
        if self._standing is None or goal == self._standing:
            return
        level = [replace(pose, a=0.0, b=0.0, c=0.0) for pose in (self._standing, goal)]
        held = [self._held(pose) for pose in level]
        belief = self._plan.estimate(self.state).belief
        way = find_route(belief, self._held(self._standing), self._held(goal), held)
        if way is None:
            raise LimitError(f"no safe way leads from {self._standing} to {goal}")
        for row in way:
            self._go(level[row])

    def _back(self, reference: Array) -> None:
        """To the point's reference as straight as is safe, or else the way that the robot came."""
        start, *trail = reversed(self._trail)
        belief = self._plan.estimate(self.state).belief
        home = self._held(self._trail[0])
        (way,) = PathPlanner(belief, self._held(start), None, reference).plan(home)
        stops = trail if way is None else [self.robot.to_command(pose) for pose in way.waypoints]
        for pose in (*stops, self._trail[0]):
            self._go(pose)

    def _go(self, pose: Pose) -> None:
        self.machine.go(self._held(pose).pose(0))
        self._standing = pose
        # What lies on the way that it came is gone back over, and need not be again.
        passed = self._trail.index(pose) if pose in self._trail else len(self._trail)
        self._trail = [*self._trail[:passed], pose]

    def _held(self, pose: Pose) -> PoseBatch:
        return self.robot.from_commands([pose])
