"""The pose to measure next at a point: chosen among many, or the next safe one of a list."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.pose_list import PoseList, is_same_pose, without_visited
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.errors import LimitError
from hexacell.experiment_design import candidates
from hexacell.experiment_design.candidates import Amplitudes
from hexacell.experiment_design.criteria import D_OPTIMAL, Criterion, CriterionName
from hexacell.experiment_design.gauge_zero import GaugeZero
from hexacell.experiment_design.pose_selection import SelectedPose, select_from_list, select_pose
from hexacell.experiment_design.travel_monte_carlo import orientation_sigma
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion.route_search import find_route
from hexacell.robot_model import Robot

WELL_KNOWN = np.radians(0.5)
"""Uncertainty of the platform's orientation below which large turns are safe, and worth most."""

SMALL_SHARE = 0.1
"""Of the tilts allowed, tried where no turn of full size is safe."""


@dataclass(frozen=True, eq=False)
class PoseChooser:
    """Chooses for one cell.

    Attributes:
        listed: poses to visit; none where they are to be chosen.
        task: where the robot has to be accurate.
        candidates: among how many orientations.
    """

    settings: CellSettings
    robot: Robot
    pose_list: PoseList | None
    task: Task
    candidates: int

    def choose_with_path(
        self, belief: RobotBelief, at: GaugeZero, state: CampaignState
    ) -> tuple[SelectedPose, tuple[Pose, ...]]:
        """As :meth:`select_pose`, and the poses to pass on the way from where the robot is now.

        These are in the controller's frames.

        Raises:
            LimitError: there is none within the limits.
        """
        choice, start = self._choose(belief, at, state)
        if state.present is None:
            return choice, ()
        visited = _visited(state)
        stops = [self._as_visited(visited, self.robot.to_command(stop)) for stop in choice.stops]
        way = [*visited[start : start + 1], *stops]
        if state.present in way:  # as a rule, and the way is checked already
            return choice, tuple(way[way.index(state.present) + 1 :])
        between = [*stops, *visited]
        held = [self.robot.from_commands([pose]) for pose in between]
        present, goal = self.robot.from_commands([state.present]), PoseBatch.of([choice.command])
        rows = find_route(belief, present, goal, held, at.reference)
        if rows is None:
            raise LimitError("no safe straight line leads on from here")
        return choice, tuple(between[row] for row in rows)

    def choose(self, belief: RobotBelief, at: GaugeZero, state: CampaignState) -> SelectedPose:
        """The pose to measure next, in the mechanism's frame convention.

        It can be reached from the pose of the last record, or else from the reference, wherever the
        robot is now: an interrupted run measures what an undisturbed one does.

        Raises:
            LimitError: there is none within the limits.
        """
        return self._choose(belief, at, state)[0]

    def _choose(self, belief: RobotBelief, at: GaugeZero, state: CampaignState) -> tuple[SelectedPose, int]:
        """The choice, and which of the poses visited here its way starts from."""
        last = max(0, len(_visited(state)) - 1)
        # The last resort is for when so little is known that nearly all turns are too large.
        *tries, resort = dict.fromkeys([(last, 1.0), (0, 1.0), (0, SMALL_SHARE)])
        for start, share in tries:
            with suppress(LimitError):
                return self._chosen(belief, at, state, start, share), start
        start, share = resort
        return self._chosen(belief, at, state, start, share), start

    def _chosen(
        self, belief: RobotBelief, at: GaugeZero, state: CampaignState, start: int, share: float
    ) -> SelectedPose:
        visited = self.robot.from_commands(_visited(state))
        begin = visited[start : start + 1] if len(visited) else None
        home = visited[:1] if start else None
        if self.pose_list is not None:
            waiting = self.robot.from_commands(
                without_visited(self.pose_list.at(state.point or 0)[1:], _visited(state))
            )
            passed_over = state.refusals
            return select_from_list(belief, at, waiting, begin, home=home, passed_over=passed_over)
        tilt = share * belief.limits.tilt
        is_known = orientation_sigma(belief, at.target) <= WELL_KNOWN
        amplitudes = Amplitudes.MOSTLY_LARGE if is_known else Amplitudes.ALL_SCALES
        turns = candidates.orientations(self.candidates, tilt, self._seed(state), amplitudes)
        return select_pose(belief, at, turns, begin, self._goal(belief), home)

    @staticmethod
    def _as_visited(visited: list[Pose], stop: Pose) -> Pose:
        """The reference as it was visited, to the last bit, where that is one of the stops."""
        return visited[0] if visited and is_same_pose(visited[0], stop) else stop

    def _goal(self, belief: RobotBelief) -> Criterion:
        criterion = CriterionName(self.settings.identification.criterion)
        if criterion is CriterionName.PARAMETERS:
            return Criterion(belief.basis.T @ belief.basis)
        error = self.task.error(belief) if criterion is CriterionName.TASK else None
        return D_OPTIMAL if error is None else Criterion(error.weight())

    def _seed(self, state: CampaignState) -> int:
        """Other candidates for every record and every attempt, and the same when done again."""
        point = state.point or 0
        attempt = state.records_at(point) + 100 * state.refusals
        return self.settings.identification.seed + 1000 * point + attempt


def _visited(state: CampaignState) -> list[Pose]:
    """The poses of the present point's records, in the controller's frames, the reference first."""
    return [record.pose for record in state.measurements.records if record.point == state.point]
