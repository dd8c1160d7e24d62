"""How to get to a pose from wherever the robot stands: by checked straight lines, or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.pose_list import is_same_pose
from hexacell.errors import HexacellError, LimitError
from hexacell.experiment_design.gauge_zero import GaugeZero
from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import estimate_online
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import is_clear
from hexacell.motion.route_search import ball_position, find_route
from hexacell.motion.waypoint_planner import PathPlanner
from hexacell.robot_model import Robot
from procedures.run.state import RunState
from procedures.run.steps import Move, SetKey, SixNumbers


class NoSafePath(LimitError):
    """No checked straight line leads on from where the robot stands; nothing moved."""


@dataclass(frozen=True, eq=False)
class RunPathPlanner:
    """The ways of one robot."""

    robot: Robot

    def is_in_order(self, state: RunState, key: SetKey) -> bool:
        """Whether the robot came by the set's own moves, each of which was checked when it was chosen."""
        return not state.off_plan and (state.standing is None or state.standing[0] == key)

    def towards(self, state: RunState, goal: Move, reference: Array | None = None) -> Move:
        """``goal`` if the straight line to it is clear, else the first move of a way round.

        With gauges at a ``reference`` (3,), mm, the ball stays inside their travel all the way, unless
        it is outside already. Ways round lead over untilted poses and over poses the set has visited.

        Raises:
            NoSafeWay: there is none.
        """
        if state.target is None:
            return goal
        via = self._between(state, goal)
        poses = [self._held(pose) for _, pose in via]
        start, end = self._held(state.target), self._held(goal.pose)
        belief = self._belief(state)
        if reference is not None and not _inside(belief, start, reference):
            reference = None
        way = find_route(belief, start, end, poses, reference)
        if way:
            orientation, pose = via[way[0]]
            return Move(at=goal.at, orientation=orientation, pose=pose)
        if way is None:
            return self._led(belief, state.target, goal, reference)
        return goal

    def _led(self, belief: RobotBelief, here: SixNumbers, goal: Move, reference: Array | None) -> Move:
        """The first stop on the way to a goal to which no straight lines lead."""
        if reference is not None:
            (way,) = PathPlanner(belief, self._held(here), None, reference).to(self._held(goal.pose))
            if way is not None:
                return self._stop(goal, way.stops[0])
        raise _no_way(here, goal)

    def back(
        self, state: RunState, key: SetKey, known: tuple[RobotBelief, GaugeZero] | None
    ) -> Move | None:
        """The next move on the way back to a set's reference, the gauges being there.

        As straight as what is ``known`` finds safe: to the reference itself, to it over stops, or to
        the earliest pose of the trail. The last resort is the way that the robot came. Nothing if it
        did not come from the reference.
        """
        trail = state.path_from_reference
        if len(trail) < 2 or state.target != trail[-1][1] or trail[0][1] != state.set(key).pose(1):
            return None
        moves = [Move(at=key, orientation=orientation, pose=pose) for orientation, pose in trail[:-1]]
        if known is None or len(moves) == 1:
            return moves[-1]
        return self._straightest(known, trail, moves)

    def _straightest(
        self,
        known: tuple[RobotBelief, GaugeZero],
        trail: Sequence[tuple[int, SixNumbers]],
        moves: list[Move],
    ) -> Move:
        """What is decided at a stop follows from where the way over the stops began.

        Decided anew, it might lead back there, and from there to the stop again.
        """
        here, home, (belief, reference) = trail[-1][1], moves[0], (known[0], known[1].reference)
        begun = next(pose for orientation, pose in reversed(trail) if orientation)
        (way,) = PathPlanner(belief, self._held(begun), None, reference).to(self._held(home.pose))
        line = [] if way is None else [Pose(*begun), *map(self.robot.to_command, way.stops)]
        passed = next((row for row, pose in enumerate(line) if is_same_pose(pose, Pose(*here))), None)
        if passed is not None:
            stops = line[passed + 1 :]
            return Move(at=home.at, orientation=0, pose=stops[0].as_tuple()) if stops else home
        start = self._held(here)
        nearest_first = (home, *moves[1:-1])
        straight = (m for m in nearest_first if is_clear(belief, start, self._held(m.pose), reference))
        return next(straight, moves[-1])

    def _stop(self, goal: Move, command: Pose) -> Move:
        """A pose of the convention's frames on the way to a goal."""
        return Move(at=goal.at, orientation=0, pose=self.robot.to_command(command).as_tuple())

    def ball_at(self, state: RunState, pose: SixNumbers) -> Array | None:
        """Where the ball really is (3,), mm, at a commanded pose, by what is known now."""
        return ball_position(self._belief(state), self._held(pose))

    def _between(self, state: RunState, goal: Move) -> list[tuple[int, SixNumbers]]:
        """Poses that a way round may lead over, with their orientations; 0 where nothing is measured."""
        samples = state.set(goal.at).samples
        visited = [(s.orientation, s.pose) for s in samples if s.orientation != goal.orientation]
        level = [_untilted(pose) for pose in (state.target, goal.pose) if pose is not None]
        return [*((0, pose) for pose in level), *visited]

    def _held(self, pose: SixNumbers) -> PoseBatch:
        return self.robot.from_commands([Pose(*pose)])

    def _belief(self, state: RunState) -> RobotBelief:
        """What is known by now; with the identified geometry in the controller, that one commands."""
        found = state.identified.result.get("geometry") if state.identified else None
        if found is None:
            return self._by_records(state)
        geometry = Geometry(**found)
        free = self.robot.mechanism.convention.free_parameters(geometry)
        known = replace(self.robot.belief(), free=np.asarray(free))
        return replace(known, controller=geometry) if state.committed else known

    def _by_records(self, state: RunState) -> RobotBelief:
        measurements = state.measurements()
        if not len(measurements):
            return self.robot.belief()
        try:
            return self.robot.belief(estimate_online(self.robot.problem(measurements)))
        except HexacellError:
            return self.robot.belief()


def _inside(belief: RobotBelief, pose: PoseBatch, reference: Array) -> bool:
    ball = ball_position(belief, pose)
    return ball is not None and bool(np.abs(ball - reference).max() <= belief.limits.gauge_travel_mm)


def _untilted(pose: SixNumbers) -> SixNumbers:
    x, y, z, *_ = pose
    return (x, y, z, 0.0, 0.0, 0.0)


def _no_way(here: SixNumbers, goal: Move) -> NoSafePath:
    return NoSafePath(
        f"{goal.at}: the robot stands at {Pose(*here)}, and no straight line that keeps to the limits "
        f"leads from there to {goal.target}; it was not moved",
        action="Bring it near that pose with its own controller, then go on",
    )
