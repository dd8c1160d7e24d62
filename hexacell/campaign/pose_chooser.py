"""The pose to measure next at a point: chosen among many, or the next safe one of a list."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.pose_list import PoseList, not_among, same
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
from hexacell.motion.route_search import route
from hexacell.robot_model import Robot

WELL_KNOWN = np.radians(0.5)
"""Uncertainty of the platform's orientation below which large turns are safe, and worth most."""

SMALL_SHARE = 0.1
"""Of the tilts allowed, tried where no turn of full size is safe."""


@dataclass(frozen=True, eq=False)
class Chooser:
    """Chooses for one cell.

    Attributes:
        listed: poses to visit; none where they are to be chosen.
        task: where the robot has to be accurate.
        candidates: among how many orientations.
    """

    settings: CellSettings
    robot: Robot
    listed: PoseList | None
    task: Task
    candidates: int

    def choose_with_path(
        self, knowledge: RobotBelief, at: GaugeZero, situation: CampaignState
    ) -> tuple[SelectedPose, tuple[Pose, ...]]:
        """As :meth:`select_pose`, and the poses to pass on the way from where the robot is now.

        These are in the controller's frames.

        Raises:
            LimitError: there is none within the limits.
        """
        choice, start = self._choose(knowledge, at, situation)
        if situation.present is None:
            return choice, ()
        visited = _visited(situation)
        stops = [self._as_visited(visited, self.robot.to_command(stop)) for stop in choice.stops]
        way = [*visited[start : start + 1], *stops]
        if situation.present in way:  # as a rule, and the way is checked already
            return choice, tuple(way[way.index(situation.present) + 1 :])
        between = [*stops, *visited]
        held = [self.held([pose]) for pose in between]
        present, goal = self.held([situation.present]), PoseBatch.of([choice.command])
        rows = route(knowledge, present, goal, held, at.reference)
        if rows is None:
            raise LimitError("no safe straight line leads on from here")
        return choice, tuple(between[row] for row in rows)

    def choose(self, knowledge: RobotBelief, at: GaugeZero, situation: CampaignState) -> SelectedPose:
        """The pose to measure next, in the mechanism's frame convention.

        It can be reached from the pose of the last record, or else from the reference, wherever the
        robot is now: an interrupted run measures what an undisturbed one does.

        Raises:
            LimitError: there is none within the limits.
        """
        return self._choose(knowledge, at, situation)[0]

    def _choose(
        self, knowledge: RobotBelief, at: GaugeZero, situation: CampaignState
    ) -> tuple[SelectedPose, int]:
        """The choice, and which of the poses visited here its way starts from."""
        last = max(0, len(_visited(situation)) - 1)
        # The last resort is for when so little is known that nearly all turns are too large.
        *tries, resort = dict.fromkeys([(last, 1.0), (0, 1.0), (0, SMALL_SHARE)])
        for start, share in tries:
            with suppress(LimitError):
                return self._chosen(knowledge, at, situation, start, share), start
        start, share = resort
        return self._chosen(knowledge, at, situation, start, share), start

    def _chosen(
        self, knowledge: RobotBelief, at: GaugeZero, situation: CampaignState, start: int, share: float
    ) -> SelectedPose:
        visited = self.held(_visited(situation))
        begin = visited[start : start + 1] if len(visited) else None
        home = visited[:1] if start else None
        if self.listed is not None:
            waiting = self.held(not_among(self.listed.at(situation.point or 0)[1:], _visited(situation)))
            passed_over = situation.refusals
            return select_from_list(knowledge, at, waiting, begin, home=home, passed_over=passed_over)
        tilt = share * knowledge.limits.tilt
        is_known = orientation_sigma(knowledge, at.stand) <= WELL_KNOWN
        amplitudes = Amplitudes.MOSTLY_LARGE if is_known else Amplitudes.ALL_SCALES
        turns = candidates.orientations(self.candidates, tilt, self._seed(situation), amplitudes)
        return select_pose(knowledge, at, turns, begin, self._goal(knowledge), home)

    def held(self, poses: Iterable[Pose]) -> PoseBatch:
        """Commanded poses in the convention's frames."""
        return self.robot.change.poses(PoseBatch.of(poses))

    @staticmethod
    def _as_visited(visited: list[Pose], stop: Pose) -> Pose:
        """The reference as it was visited, to the last bit, where that is one of the stops."""
        return visited[0] if visited and same(visited[0], stop) else stop

    def _goal(self, knowledge: RobotBelief) -> Criterion:
        criterion = CriterionName(self.settings.identification.criterion)
        if criterion is CriterionName.PARAMETERS:
            return Criterion(knowledge.basis.T @ knowledge.basis)
        error = self.task.error(knowledge) if criterion is CriterionName.TASK else None
        return D_OPTIMAL if error is None else Criterion(error.weight())

    def _seed(self, situation: CampaignState) -> int:
        """Other candidates for every record and every attempt, and the same when done again."""
        point = situation.point or 0
        attempt = situation.records_at(point) + 100 * situation.refusals
        return self.settings.identification.seed + 1000 * point + attempt


def _visited(situation: CampaignState) -> list[Pose]:
    """The poses of the present point's records, in the controller's frames, the reference first."""
    return [record.pose for record in situation.measurements.records if record.point == situation.point]
