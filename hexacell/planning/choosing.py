"""The pose to measure next at a point: chosen among many, or the next safe one of a list."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass

from hexacell.cell.model import CellSettings
from hexacell.design import candidates
from hexacell.design.goal import D_OPTIMAL, Criterion, Goal
from hexacell.design.knowledge import Knowledge
from hexacell.design.next_pose import Choice, Station, choose
from hexacell.design.route import route
from hexacell.errors import LimitError
from hexacell.planning.listed import PoseList, choose_listed, not_among
from hexacell.planning.situation import Situation
from hexacell.planning.task import Task
from hexacell.pose import Pose, Poses
from hexacell.robot import Robot

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
        """As :meth:`choose`, and the poses to pass on the way, if no straight line leads there.

        These are in the controller's frames, poses of the point that were visited before.

        Raises:
            LimitError: there is none within the limits.
        """
        visited = _visited(situation)
        if self.listed is None and visited and situation.present == visited[-1]:
            with suppress(LimitError):  # as a rule the robot stands there, and the line is checked already
                return self._chosen(knowledge, at, situation, self.held(visited[-1:])), ()
        choice = self.choose(knowledge, at, situation)
        if self.listed is not None or situation.present is None:
            return choice, ()
        start, *between = (self.held([pose]) for pose in (situation.present, *visited))
        way = route(knowledge, start, Poses.of([choice.command]), between, at.reference)
        if way is None:
            raise LimitError("no safe straight line leads on from here")
        return choice, tuple(visited[row] for row in way)

    def choose(self, knowledge: Knowledge, at: Station, situation: Situation) -> Choice:
        """The pose to measure next, in the mechanism's frame convention.

        One of a list can be reached by a straight line from the present pose. A chosen one can be so
        from the pose of the last record, or else from the reference, wherever the robot is now: an
        interrupted run measures what an undisturbed one does.

        Raises:
            LimitError: there is none within the limits.
        """
        if self.listed is not None:
            present = None if situation.present is None else self.held([situation.present])
            return self._listed(self.listed, knowledge, at, situation, present)
        visited = self.held(_visited(situation))
        last, reference = (visited[-1:], visited[:1]) if len(visited) else (None, None)
        try:
            return self._chosen(knowledge, at, situation, last)
        except LimitError:
            pass
        try:
            return self._chosen(knowledge, at, situation, reference)
        except LimitError:
            # So little is known that nearly all turns are too large.
            return self._chosen(knowledge, at, situation, reference, share=SMALL_SHARE)

    def _chosen(
        self,
        knowledge: Knowledge,
        at: Station,
        situation: Situation,
        start: Poses | None,
        share: float = 1.0,
    ) -> Choice:
        tilt = share * knowledge.limits.tilt
        turns = candidates.orientations(self.candidates, tilt, self._seed(situation))
        return choose(knowledge, at, turns, start, self._goal(knowledge))

    def held(self, poses: Iterable[Pose]) -> Poses:
        """Commanded poses in the convention's frames."""
        return self.robot.change.poses(Poses.of(poses))

    def _goal(self, knowledge: Knowledge) -> Goal:
        criterion = Criterion(self.settings.identification.criterion)
        if criterion is Criterion.PARAMETERS:
            return Goal(knowledge.basis.T @ knowledge.basis)
        error = self.task.error(knowledge) if criterion is Criterion.TASK else None
        return D_OPTIMAL if error is None else Goal(error.weight())

    def _listed(
        self,
        listed: PoseList,
        knowledge: Knowledge,
        at: Station,
        situation: Situation,
        present: Poses | None,
    ) -> Choice:
        waiting = not_among(listed.at(situation.point or 0)[1:], _visited(situation))
        return choose_listed(knowledge, at, self.held(waiting), present, situation.refusals)

    def _seed(self, situation: Situation) -> int:
        """Other candidates for every record and every attempt, and the same when done again."""
        point = situation.point or 0
        attempt = situation.records_at(point) + 100 * situation.refusals
        return self.settings.identification.seed + 1000 * point + attempt


def _visited(situation: Situation) -> list[Pose]:
    """The poses of the present point's records, in the controller's frames, the reference first."""
    return [record.pose for record in situation.measurements.records if record.point == situation.point]
