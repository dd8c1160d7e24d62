"""The pose to measure next at a point: chosen among many, or the next safe one of a list."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.design import candidates
from hexacell.design.candidates import Amplitudes
from hexacell.design.goal import D_OPTIMAL, Criterion, Goal
from hexacell.design.knowledge import Knowledge
from hexacell.design.next_pose import Choice, choose, choose_in_turn
from hexacell.design.route import route
from hexacell.design.second_order import turn_sigma
from hexacell.design.station import Station
from hexacell.errors import LimitError
from hexacell.planning.listed import PoseList, not_among, same
from hexacell.planning.situation import Situation
from hexacell.planning.task import Task
from hexacell.pose import Pose, Poses
from hexacell.robot import Robot

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

    def choose_round(
        self, knowledge: Knowledge, at: Station, situation: Situation
    ) -> tuple[Choice, tuple[Pose, ...]]:
        """As :meth:`choose`, and the poses to pass on the way from where the robot is now.

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
        present, goal = self.held([situation.present]), Poses.of([choice.command])
        rows = route(knowledge, present, goal, held, at.reference)
        if rows is None:
            raise LimitError("no safe straight line leads on from here")
        return choice, tuple(between[row] for row in rows)

    def choose(self, knowledge: Knowledge, at: Station, situation: Situation) -> Choice:
        """The pose to measure next, in the mechanism's frame convention.

        It can be reached from the pose of the last record, or else from the reference, wherever the
        robot is now: an interrupted run measures what an undisturbed one does.

        Raises:
            LimitError: there is none within the limits.
        """
        return self._choose(knowledge, at, situation)[0]

    def _choose(self, knowledge: Knowledge, at: Station, situation: Situation) -> tuple[Choice, int]:
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
        self, knowledge: Knowledge, at: Station, situation: Situation, start: int, share: float
    ) -> Choice:
        visited = self.held(_visited(situation))
        begin = visited[start : start + 1] if len(visited) else None
        home = visited[:1] if start else None
        if self.listed is not None:
            waiting = self.held(not_among(self.listed.at(situation.point or 0)[1:], _visited(situation)))
            passed_over = situation.refusals
            return choose_in_turn(knowledge, at, waiting, begin, home=home, passed_over=passed_over)
        tilt = share * knowledge.limits.tilt
        is_known = turn_sigma(knowledge, at.stand) <= WELL_KNOWN
        amplitudes = Amplitudes.MOSTLY_LARGE if is_known else Amplitudes.ALL_SCALES
        turns = candidates.orientations(self.candidates, tilt, self._seed(situation), amplitudes)
        return choose(knowledge, at, turns, begin, self._goal(knowledge), home)

    def held(self, poses: Iterable[Pose]) -> Poses:
        """Commanded poses in the convention's frames."""
        return self.robot.change.poses(Poses.of(poses))

    @staticmethod
    def _as_visited(visited: list[Pose], stop: Pose) -> Pose:
        """The reference as it was visited, to the last bit, where that is one of the stops."""
        return visited[0] if visited and same(visited[0], stop) else stop

    def _goal(self, knowledge: Knowledge) -> Goal:
        criterion = Criterion(self.settings.identification.criterion)
        if criterion is Criterion.PARAMETERS:
            return Goal(knowledge.basis.T @ knowledge.basis)
        error = self.task.error(knowledge) if criterion is Criterion.TASK else None
        return D_OPTIMAL if error is None else Goal(error.weight())

    def _seed(self, situation: Situation) -> int:
        """Other candidates for every record and every attempt, and the same when done again."""
        point = situation.point or 0
        attempt = situation.records_at(point) + 100 * situation.refusals
        return self.settings.identification.seed + 1000 * point + attempt


def _visited(situation: Situation) -> list[Pose]:
    """The poses of the present point's records, in the controller's frames, the reference first."""
    return [record.pose for record in situation.measurements.records if record.point == situation.point]
