"""The pose to measure next at a point, and the path to it: selected, or the next safe one of a list."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.pose_list import PoseList
from hexacell.campaign.task_accuracy import Task
from hexacell.campaign.time_model import TimeModel
from hexacell.cell.model import CellSettings
from hexacell.design import candidates
from hexacell.design.arrival_sides import with_best_sides
from hexacell.design.candidates import Amplitudes, ReachableTargets
from hexacell.design.criteria import D_OPTIMAL, Criterion
from hexacell.design.pose_selection import SelectedPose, select_from_list, select_pose
from hexacell.design.predicted_records import GaugeZero
from hexacell.design.search_effort import SearchEffort
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.identified_zeros import ParameterChoice, zero_columns
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.limits.limits import Limits
from hexacell.motion.arrival import least_way
from hexacell.motion.overshoot import overshoot
from hexacell.motion.paths import PathPlanner, find_route
from hexacell.robot.model import Robot

WELL_KNOWN_SIGMA = np.radians(0.5)
"""Standard deviation of the platform's orientation below which large rotations are safe, and most
informative."""

FIRST_TURN = np.radians(0.3)
"""Turn of the first pose of all, rad: two in a thousand robots within the tolerances that can stand at the
first reference have less than a degree left there to the end of a passive joint, and none shows it."""

SMALL_TILT_SHARE = 0.1
"""Share of the largest tilt, for candidates where none of full size is safe."""


@dataclass(frozen=True, eq=False)
class PoseChooser:
    """Chooses poses for one cell.

    Attributes:
        pose_list: poses to visit; None where they are to be selected.
        known_then: gives the covariance (p, p) once all that is planned is measured but the next record,
            which has to gain beside it as soon as the robot is well known; None where the plan may end
            sooner.
        most_turned: the largest angle from the reference to a selected pose, rad, by the estimate.
    """

    settings: CellSettings
    robot: Robot
    pose_list: PoseList | None
    task: Task
    effort: SearchEffort
    known_then: Callable[[RobotBelief, CampaignState], Array] | None = None
    most_turned: float = np.pi

    def choose(
        self, belief: RobotBelief, zero: GaugeZero, state: CampaignState
    ) -> tuple[SelectedPose, tuple[Pose, ...]]:
        """The pose to measure next, and the poses to pass on the path from where the robot is now.

        The pose is in the mechanism's frame convention, the path in the controller's frames. The pose
        can be reached from the pose of the last record, or else from the reference, wherever the robot
        is now: an interrupted run measures the same poses as an undisturbed one, unless no straight line
        leads onto the path. Where it is not known where the robot is, there is no path.

        Raises:
            LimitError: there is no pose, or no path to it, within the limits.
        """
        for selected, start in self._selections(belief, zero, state):
            if (path := self._path(belief, zero, state, selected, start)) is not None:
                return selected, path
        raise LimitError("no safe straight line starts here")

    def _path(
        self, belief: RobotBelief, zero: GaugeZero, state: CampaignState, selected: SelectedPose, start: int
    ) -> tuple[Pose, ...] | None:
        """The poses between the present one and the selected one, whose path starts from a row of records.

        None where no straight line leads onto that path, after an interrupted run returned by another way.
        """
        if state.present is None:
            return ()
        visited = _visited(state)
        waypoints = [_as_visited(visited[:1], self.robot.to_command(pose)) for pose in selected.waypoints]
        path = [*visited[start : start + 1], *waypoints]
        if state.present in path:  # the usual case; the path was checked when the pose was selected
            return tuple(path[path.index(state.present) + 1 :])
        via = [*waypoints, *visited]
        commands = [self.robot.from_commands([pose]) for pose in via]
        present, end = self.robot.from_commands([state.present]), PoseBatch.of([selected.command])
        route = find_route(belief, present, end, commands, zero.reference)
        return None if route is None else tuple(via[row] for row in route)

    def _selections(
        self, belief: RobotBelief, zero: GaugeZero, state: CampaignState
    ) -> Iterator[tuple[SelectedPose, int]]:
        """Poses to measure, the best first, and the row of the point's record that the path starts from."""
        for row in dict.fromkeys([max(0, len(_visited(state)) - 1), 0]):
            with suppress(LimitError):
                yield self._select(belief, zero, state, row), row
        # So little may be known that nearly all candidates of full size are too large.
        yield self._select(belief, zero, state, 0, SMALL_TILT_SHARE), 0

    def _select(
        self, belief: RobotBelief, zero: GaugeZero, state: CampaignState, row: int, tilt_share: float = 1.0
    ) -> SelectedPose:
        """The best pose with a path from a row of the point's records."""
        visited = self.robot.from_commands(_visited(state))
        start = visited[row : row + 1] if len(visited) else zero.command(belief)
        planner = PathPlanner(belief, start, visited[:1] if row else None, zero.reference)
        if self.pose_list is not None:
            done, listed = PoseBatch.of(_visited(state)), self.pose_list.at(state.point or 0)[1:]
            waiting = [one for one in listed if not done.is_same(PoseBatch.of([one])).any()]
            return select_from_list(planner, zero, self.robot.from_commands(waiting), state.rejections)
        well_known = is_well_known(belief, zero)
        is_blind = len(state.steering) == 1 and not well_known
        most = min(self.most_turned, FIRST_TURN) if is_blind else self.most_turned
        turns = self._turns(belief.limits, state, well_known, most, tilt_share)
        known_then = self.known_then(belief, state) if well_known and self.known_then else None
        refinement = self.effort.refinement(len(state.measurements))
        rounds = () if most < np.pi else refinement  # which would turn candidates further
        criterion = self._criterion(belief)
        selected = select_pose(
            planner, zero, turns, criterion, known_then, rounds, self._seconds_from(planner)
        )
        return with_best_sides(planner, zero, selected, self._back, criterion, known_then)

    def _seconds_from(self, planner: PathPlanner) -> Callable[[ReachableTargets], Array] | None:
        """What records take from the planner's start (n,), s; None where that cannot be computed."""
        start = planner.lines.actual_start
        return partial(self._times.seconds_to, planner.belief, start) if start.found[0] else None

    @cached_property
    def _times(self) -> TimeModel:
        return TimeModel.of(self.settings)

    @cached_property
    def _back(self) -> float:
        """How far joints stand beside their places before a stop; 0 where all stops have one side."""
        least = least_way(self.settings.mechanism.words.joint_unit, self.robot.noise.stops)
        return 0.0 if self.settings.motion.sign else overshoot(least, self.settings.model.backlash)

    def _turns(
        self, limits: Limits, state: CampaignState, well_known: bool, most: float, tilt_share: float
    ) -> Array:
        """Candidates (n, 3, 3), relative to the platform's orientation at the reference."""
        count = self.effort.considered(len(state.measurements), is_well_known=well_known)
        amplitudes = Amplitudes.MOSTLY_LARGE if well_known else Amplitudes.ALL_SCALES
        tilt, turn = min(tilt_share * limits.tilt, most), min(limits.turn, most)
        # The seed differs for every record and every attempt, and is the same when they are repeated.
        point = state.point or 0
        attempt = state.records_at(point) + 100 * state.rejections + 10_000 * len(state.pilots)
        seed = self.settings.identification.seed + 1000 * point + attempt
        turns = candidates.orientations(count, tilt, seed, amplitudes, turn)
        return np.asarray(turns[np.linalg.norm(rotations.to_vector(turns), axis=1) <= most])

    def _criterion(self, belief: RobotBelief) -> Criterion:
        name = self.settings.identification.criterion
        if name == "parameters":
            mechanism = belief.mechanism
            scaled = mechanism.convention.basis / mechanism.parameters.like_a_mm[:, None]
            return Criterion(scaled.T @ scaled)
        if name == "information" and self.robot.identifies is not ParameterChoice.ALL:
            columns = zero_columns(self.robot.mechanism, self.robot.controller)
            return Criterion(columns @ columns.T)
        error = self.task.error(belief) if name == "task" else None
        return D_OPTIMAL if error is None else Criterion(error.weight())


def is_well_known(belief: RobotBelief, zero: GaugeZero) -> bool:
    """Whether the platform's orientation at a zero is known so well that large rotations are safe."""
    return bool(belief.orientation_sigma(zero.target.poses, zero.target.joints) <= WELL_KNOWN_SIGMA)


def _as_visited(visited: list[Pose], waypoint: Pose) -> Pose:
    """A waypoint exactly as visited, if it was."""
    same = PoseBatch.of(visited).is_same(PoseBatch.of([waypoint]))
    return visited[int(np.argmax(same))] if same.any() else waypoint


def _visited(state: CampaignState) -> list[Pose]:
    """The poses of the present point's records, in the controller's frames, the reference first."""
    return [record.pose for record in state.measurements.records if record.point == state.point]
