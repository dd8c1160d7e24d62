"""The steps within a set of poses and the moves between them: along checked straight lines, or none.

The gauges are tried whenever they were placed or connected again: at each set where a person places them,
otherwise at the first one. From the recorded reference the ball is moved a millimetre along each axis of
the base, and the gauges are read. Back at the reference it is judged whether each of them follows the ball
on its axis, with its sign and scale (:mod:`hexacell.noise.gauge_trial`). Where they seem not to, the moves
are repeated, twice as far each time as long as the gauges' travel allows. Only then is anything else
measured.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from hexacell.campaign.decisions import MeasurePose
from hexacell.campaign.pilots import pilot_number, with_pilots
from hexacell.cell.model import CellSettings
from hexacell.design.predicted_records import GaugeZero
from hexacell.errors import HexacellError, LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import estimate_online
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import ball_position, is_clear
from hexacell.motion.paths import PathPlanner, find_route, next_return_move
from hexacell.noise.allowances import Allowances
from hexacell.noise.gauge_trial import AXES
from hexacell.robot.model import Robot
from procedures.run.keys import Phase, SetKey, SixNumbers, ThreeNumbers
from procedures.run.state import RunState
from procedures.steps.close import CloseSet
from procedures.steps.events import Step
from procedures.steps.move import Expectation, Move
from procedures.steps.place import Place, are_fixed
from procedures.steps.probe import Probe
from procedures.steps.revisit import Revisit
from procedures.steps.sample import Sample
from procedures.steps.try_gauges import Try, trial_of

Known = tuple[RobotBelief, GaugeZero]
"""What is known of the robot, and where the ball was when a set's gauges were zeroed."""

ELSEWHERE = 3.0
"""The gauges are surely not at a ball that is farther from their zero than so many times their room."""

FARTHEST_SHARE = 0.3
"""Length of the largest moves by which gauges are tried, as a share of their travel."""


class TravelError(LimitError):
    """A plunger is at an end of its travel where the gauges must be read."""


class NoSafePath(LimitError):
    """No checked straight line starts at the robot's position; nothing moved."""


@dataclass(frozen=True, eq=False)
class SetSteps:
    """Decides on the steps of the sets of one robot, and plans its moves.

    A set's ``ball`` (3,), mm, is where the ball was when its gauges were zeroed; None where unknown.
    """

    robot: Robot
    settings: CellSettings
    allowances: Allowances

    @property
    def trial_mm(self) -> float:
        """The length of a move by which the gauges are tried, 0 for no trial."""
        return self.settings.stations.trial_mm

    def due_first(self, state: RunState, key: SetKey, ball: Array | None) -> Step | None:
        """What an open set needs before anything else is measured; None if it needs nothing.

        Raises ``LimitError`` if the gauges are to be tried, and no small move is possible.
        """
        if state.set(key).reference_unverified:
            return self.at_or_to_reference(state, key, ball)
        return self._trial(state, key, ball)

    def at_pose(self, state: RunState, key: SetKey, orientation: int | None = None) -> Step | None:
        """Place the gauges or sample, if the robot is at an orientation: by default the lowest missing."""
        orientation = orientation or state.set(key).next_orientation
        if state.at_pose != (key, orientation) or state.target is None:
            return None
        if orientation == 1 and not state.set(key).placed:
            return Place(at=key, pose=state.target)
        return Sample(at=key, orientation=orientation, pose=state.target)

    def at_reference(self, state: RunState, key: SetKey) -> Step | None:
        """Verify the set's reference, or close the set, if the robot is there."""
        if state.at_pose != (key, 1):
            return None
        return Revisit(at=key) if state.set(key).reference_unverified else CloseSet(at=key)

    def at_or_to_reference(self, state: RunState, key: SetKey, ball: Array | None) -> Step:
        """What is due at the set's reference, or the move there."""
        return self.at_reference(state, key) or self.to_reference(state, key, ball)

    def to_reference(self, state: RunState, key: SetKey, ball: Array | None) -> Move:
        """Move to the set's reference by a checked path; raises ``NoSafePath``."""
        move = reference_move(state, key)
        if not state.refused.allows(move.pose):
            problem = f"{key}: the controller refuses its reference {move.target}, to which it must return"
            raise NoSafePath(problem, action="Widen the limits of the controller, then continue")
        return self.towards(state, move, ball)

    def is_clear_both_ways(
        self, belief: RobotBelief, reference: SixNumbers, pose: SixNumbers, ball: Array | None
    ) -> bool:
        """Whether the robot gets from a reference to a pose and back within the limits."""
        here, there = (self.robot.from_commands([Pose(*one)]) for one in (reference, pose))
        return is_clear(belief, here, there, ball) and is_clear(belief, there, here, ball)

    def way_back(self, state: RunState, key: SetKey, known: Known | None) -> Move:
        """The next move to the reference of a set; raises ``HexacellError`` if no safe path leads there.

        It leads along the path on which the robot came. Where something is ``known`` that is shortened
        (:func:`hexacell.motion.paths.next_return_move`).
        """
        visited = state.path_from_reference
        if len(visited) < 2 or state.target != visited[-1][1] or visited[0][1] != state.set(key).pose(1):
            return self.to_reference(state, key, None if known is None else known[1].reference)
        moves = [Move(at=key, orientation=orientation, pose=pose) for orientation, pose in visited[:-1]]
        if known is None or len(moves) == 1:
            return moves[-1]
        belief, zero = known
        commands = self.robot.from_commands(Pose(*pose) for _, pose in visited)
        departure = max(row for row, (orientation, _) in enumerate(visited) if orientation)
        move = next_return_move(belief, zero.reference, commands, departure)
        return moves[move] if isinstance(move, int) else self._waypoint(key, move)

    def towards(self, state: RunState, goal: Move, reference: Array | None = None) -> Move:
        """The next move towards ``goal``: ``goal`` itself if the straight line to it is clear.

        With gauges zeroed where the ball was at ``reference`` (3,), mm, the ball stays inside their
        travel on the path, unless it is outside already. After an interruption the robot may be far from
        the set's gauges. Raises ``NoSafePath``.
        """
        if state.target is None:
            return goal
        start = self.command(state.target)
        belief = self._belief(state).zeroed_at(state.zero_shown(goal.at))
        move = self._next_move(state, goal, belief, reference)
        if reference is None or _is_inside(belief, start, reference, ELSEWHERE):
            return move
        return move.model_copy(update={"from_elsewhere": True})

    def _next_move(self, state: RunState, goal: Move, belief: RobotBelief, reference: Array | None) -> Move:
        """Intermediate poses are level ones, poses that the set has visited, and waypoints."""
        assert state.target is not None  # noqa: S101 - otherwise there is nothing to plan from
        levels = (Pose(*pose).level.as_tuple() for pose in (state.target, goal.pose))
        samples = state.set(goal.at).samples
        visited = [(s.orientation, s.pose) for s in samples if s.orientation != goal.orientation]
        via = [*((0, pose) for pose in levels), *visited]
        start, end = self.command(state.target), self.command(goal.pose)
        if reference is not None and not _is_inside(belief, start, reference):
            reference = None
        route = find_route(belief, start, end, [self.command(pose) for _, pose in via], reference)
        if route:
            orientation, pose = via[route[0]]
            return Move(at=goal.at, orientation=orientation, pose=pose)
        if route is not None:
            return goal
        paths = [] if reference is None else PathPlanner(belief, start, None, reference).plan(end)
        for path in paths:
            if path is not None:
                return self._waypoint(goal.at, path.waypoints[0])
        raise NoSafePath(
            f"{goal.at}: the robot is at {Pose(*state.target)}, and no straight line within the limits "
            f"leads from there to {goal.target}; it was not moved",
            action="Bring it near that pose with its own controller, then continue",
        )

    def known(self, state: RunState, key: SetKey) -> tuple[RobotBelief, Array | None]:
        """The robot, and where its ball is (3,), mm, with a set's gauges at zero; None before they are."""
        belief, samples = self._belief(state).zeroed_at(state.zero_shown(key)), state.set(key).samples
        ball = ball_position(belief, self.command(samples[0].pose)) if samples else None
        if ball is None:
            return belief, None
        return belief, ball - self.robot.frames.base @ np.array(samples[0].deviation_mm)

    def ball_at_reference(self, state: RunState, key: SetKey) -> Array | None:
        """The position (3,), mm, of the ball at a set's reference by what is known now; None before."""
        pose = state.set(key).pose(1)
        return None if pose is None else ball_position(self._belief(state), self.command(pose))

    def _waypoint(self, key: SetKey, command: Pose) -> Move:
        """A move to a pose in the convention's frames at which nothing is measured."""
        return Move(at=key, orientation=0, pose=self.robot.to_command(command).as_tuple())

    def command(self, pose: SixNumbers) -> PoseBatch:
        """A pose of the controller as a command (1) in the convention's frames."""
        return self.robot.from_commands([Pose(*pose)])

    def _belief(self, state: RunState) -> RobotBelief:
        if state.identified is None:
            measurements = with_pilots(state.measurements(), state.pilots)
            with suppress(HexacellError):
                if len(measurements):
                    return self.robot.belief(estimate_online(self.robot.problem(measurements)))
            return self.robot.belief()
        geometry = state.identified.result.identified(self.robot.mechanism.parameters)
        free = self.robot.mechanism.convention.free_parameters(geometry)
        return replace(self.robot.belief(), free=np.asarray(free))

    def _trial(self, state: RunState, key: SetKey, ball: Array | None) -> Step | None:
        """The next step of a trial; None if none is due."""
        measured = state.set(key)
        # On the seats of a length check gauges are mounted one by one.
        have_stayed = are_fixed(self.settings, key) and key.phase is not Phase.LENGTH
        is_passed = measured.tried or (state.gauges_tried and have_stayed)
        if not self.trial_mm or is_passed or not measured.samples:
            return None
        rounds, axis = divmod(len(measured.probes), AXES)
        is_last = rounds >= len(self._distances)  # there is no larger move
        if rounds and axis == 0 and (is_last or not trial_of(self.allowances, measured).findings):
            is_back = state.at_pose == (key, 1)
            return Try(at=key) if is_back else self.to_reference(state, key, ball)
        moved = self._moved(state, key, axis, self._distances[rounds])
        pose = beside(reference_pose(state, key), moved)
        if state.off_plan and state.target == pose:
            return Probe(at=key, moved_mm=moved)
        probed = [beside(reference_pose(state, key), probe.moved_mm) for probe in measured.probes[-1:]]
        is_beside = state.off_plan and not state.position_unknown and state.target in probed
        if state.at_pose != (key, 1) and not is_beside:
            return self.to_reference(state, key, ball)
        return Move(at=key, orientation=0, pose=pose)

    @cached_property
    def _distances(self) -> tuple[float, ...]:
        """Lengths of the moves of each round; at the largest there are two."""
        farthest = max(self.trial_mm, FARTHEST_SHARE * self.robot.limits.room.smallest_mm)
        doublings = int(np.log2(farthest / self.trial_mm))
        smaller = [self.trial_mm * 2.0**doubling for doubling in range(doublings + 1)]
        return (*smaller, farthest, farthest)

    def _moved(self, state: RunState, key: SetKey, axis: int, farthest_mm: float) -> ThreeNumbers:
        """The move along an axis, to the side on which there is room, as far as there is."""
        belief = self.robot.belief().zeroed_at(state.zero_shown(key))  # the robot as it was drawn
        reference = reference_pose(state, key)
        ball = ball_position(belief, self.robot.from_commands([Pose(*reference)]))
        for distance, side in product(dict.fromkeys((farthest_mm, self.trial_mm)), (1.0, -1.0)):
            x, y, z = (side * distance * np.eye(AXES)[axis]).tolist()
            if self.is_clear_both_ways(belief, reference, beside(reference, (x, y, z)), ball):
                return (x, y, z)
        raise LimitError(
            f"{key}: the gauges cannot be tried, because the robot cannot move by {self.trial_mm:g} mm "
            f"along {'xyz'[axis]} there within its limits",
            action="Choose another point, or a smaller trial_mm in [stations]",
        )


def _is_inside(belief: RobotBelief, command: PoseBatch, reference: Array, share: float = 1.0) -> bool:
    ball = ball_position(belief, command)
    return ball is not None and bool(belief.limits.within_travel(ball - reference, share=share))


def beside(reference: SixNumbers, moved: ThreeNumbers) -> SixNumbers:
    """A reference moved along x, y and z."""
    (x, y, z, a, b, c), (dx, dy, dz) = reference, moved
    return (x + dx, y + dy, z + dz, a, b, c)


def reference_pose(state: RunState, key: SetKey) -> SixNumbers:
    """The pose of a set's first record."""
    pose = state.set(key).pose(1)
    assert pose is not None  # noqa: S101 - callers have a set with records
    return pose


def reference_move(state: RunState, key: SetKey) -> Move:
    """The straight move to a set's reference."""
    return Move(at=key, orientation=1, pose=reference_pose(state, key))


def require_zero(state: RunState, key: SetKey) -> None:
    """Raise ``TravelError`` if the gauges of a set could not be zeroed."""
    measured = state.set(key)
    if not measured.samples and measured.rejections:
        raise TravelError(f"{key}: the gauges cannot be zeroed, they are at the end of their travel")


def move_to_chosen(state: RunState, chosen: MeasurePose) -> Move:
    """The move to the chosen pose, or to the first waypoint of its path."""
    at = SetKey(phase=Phase.IDENTIFY, point=chosen.point)
    if chosen.via:
        pose = chosen.via[0].as_tuple()
        by_pose = {sample.pose: sample.orientation for sample in state.set(at).samples}
        return Move(at=at, orientation=by_pose.get(pose, 0), pose=pose)
    is_pilot = pilot_number(chosen.orientation) is not None
    return Move(
        at=at,
        orientation=chosen.orientation if is_pilot else state.set(at).next_orientation,
        pose=chosen.pose.as_tuple(),
        expected=Expectation(
            deviation_mm=chosen.deviation, sigma_mm=chosen.sigma, gain=chosen.gain, forecast=chosen.forecast
        ),
    )
