"""A campaign on a virtual robot that moves as a real one does.

It moves along the controller's straight lines and on its own geometry, so that the plan's limits of
travel and singularity margin are put to the test and not assumed.
"""

import numpy as np

from hexacell.campaign.decisions import MeasurePose, StartPoint
from hexacell.campaign.planner import Plan
from hexacell.cell.model import CellSettings
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.motion.paths import next_return_move
from hexacell.robot.model import Robot
from hexacell.robot.virtual_robot import VirtualRobot


class SimulatedCampaign(VirtualCampaign):
    """One campaign, with all its moves.

    Args:
        settings: of the cell.
        robot: what is known of the robot before.
        truth: its geometry, in the mechanism's frame convention.
        random: of the noise.
    """

    def __init__(
        self, settings: CellSettings, robot: Robot, truth: Geometry, random: np.random.Generator
    ) -> None:
        plan = Plan(settings, robot, with_forecast=False)
        super().__init__(plan, VirtualRobot(robot, truth, random))
        self._trail: list[tuple[Pose, bool]] = []

    @property
    def robot(self) -> Robot:
        """What is known of the robot, beside its records."""
        return self.plan.robot

    @property
    def largest_mm(self) -> float:
        """The largest deviation on any axis."""
        return max(float(np.abs(record.deviation).max()) for record in self.measurements.records)

    def _go_to_point(self, start: StartPoint) -> None:
        """Go to another point, over level poses if the straight line is not clear."""
        if not self._trail:
            self.virtual_robot.place(start.pose)
        elif start.pose != self.virtual_robot.command:
            here = self.virtual_robot.command
            route = self.plan.route(self.state, here, start.pose)
            if route is None:
                raise LimitError(f"no safe path leads from {here} to {start.pose}")
            for pose in (*route, start.pose):
                self.virtual_robot.move(pose)
        self._trail = [(start.pose, True)]

    def _go_to_pose(self, measure: MeasurePose) -> None:
        for pose in measure.via:
            self._move(pose)
        self._move(measure.pose, is_measured=True)

    def _return_to(self, reference: Pose) -> None:
        zero = self.plan.estimate(self.state).gauge_zero(self.state.point or 0)
        while self.virtual_robot.command != reference:
            trail = self.robot.from_commands(pose for pose, _ in self._trail)
            departure = max(row for row, (_, measured) in enumerate(self._trail) if measured)
            move = next_return_move(self._belief, zero.reference, trail, departure)
            self._move(self._trail[move][0] if isinstance(move, int) else self.robot.to_command(move))

    @property
    def _belief(self) -> RobotBelief:
        return self.plan.estimate(self.state).belief

    def _move(self, pose: Pose, *, is_measured: bool = False) -> None:
        """Move along a straight line; what is left of the trail is the path from the reference."""
        self.virtual_robot.move(pose)
        passed = next((row for row, (other, _) in enumerate(self._trail) if other == pose), None)
        self._trail = [*self._trail, (pose, is_measured)] if passed is None else self._trail[: passed + 1]
