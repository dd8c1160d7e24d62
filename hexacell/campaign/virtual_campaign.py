"""A plan carried out on a virtual robot, decision by decision, without hardware."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hexacell.campaign.decisions import (
    CampaignState,
    Decision,
    Finished,
    FinishPoint,
    MeasurePose,
    StartPoint,
)
from hexacell.campaign.planner import Plan
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet
from hexacell.virtual_robot.virtual_robot import VirtualRobot


@dataclass(eq=False)
class VirtualCampaign:
    """One campaign, from the first reference to the end of the plan.

    The robot is placed at each pose; what is between is left to subclasses.

    Attributes:
        state: what the next decision depends on.
        outside: number of records at which the ball left the gauges' travel; they are not taken.
        largest_mm: the largest deviation on any axis, of records taken or not.
        reason: why the plan ended.
    """

    plan: Plan
    virtual_robot: VirtualRobot
    state: CampaignState = field(default_factory=CampaignState)
    outside: int = 0
    largest_mm: float = 0.0
    reason: str = ""

    @property
    def measurements(self) -> MeasurementSet:
        """The records taken so far."""
        return self.state.measurements

    def carry_out(self) -> None:
        """Carry out all that the plan decides.

        Raises:
            HexacellError: a decision cannot be made or carried out.
        """
        while not isinstance(self.step(), Finished):
            pass

    def step(self) -> Decision:
        """Make one decision and carry it out.

        Raises:
            HexacellError: it cannot be made or carried out.
        """
        decision = self.plan.decide(self.state)
        match decision:
            case StartPoint():
                self._go_to_point(decision)
                self.virtual_robot.zero_gauges()
                self._measure(decision)
            case MeasurePose():
                self._go_to_pose(decision)
                self._measure(decision)
            case FinishPoint(point=point):
                self._finish(point, self.plan.reference_pose(point))
            case Finished(reason=reason):
                self.reason = reason
        return decision

    def _go_to_point(self, start: StartPoint) -> None:
        self.virtual_robot.place(start.pose)

    def _go_to_pose(self, measure: MeasurePose) -> None:
        self.virtual_robot.place(measure.pose)

    def _return_to(self, reference: Pose) -> None:
        """Go back to the reference of the present point."""

    def _leave_point(self) -> None:
        """A point was finished."""

    def _measure(self, decision: StartPoint | MeasurePose) -> None:
        state, point = self.state, decision.point
        record = self.virtual_robot.measure(point, decision.orientation)
        deviation = float(np.abs(record.deviation).max())
        self.largest_mm = max(self.largest_mm, deviation)
        if deviation > self.plan.robot.limits.gauge_travel_mm:
            self.outside += 1
            self.state = replace(state, present=decision.pose, rejections=state.rejections + 1)
            return
        self.state = CampaignState(
            MeasurementSet((*state.measurements.records, record)),
            point,
            state.done,
            decision.pose,
            state.rejections if state.point == point else 0,
        )

    def _finish(self, point: int, reference: Pose) -> None:
        """Return to the point's reference; it is finished if nothing can be measured from there either."""
        if self.state.present != reference:
            self._return_to(reference)
            self.state = replace(self.state, present=reference)
            return
        self.state = CampaignState(self.state.measurements, done=self.state.done | {point})
        self._leave_point()
