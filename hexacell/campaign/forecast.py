"""Forecast of the gain of further records, for display and for the choice of points.

The poses that will be selected at a point are represented by a set of well spread ones: the greedy
D-optimal set for the robot as drawn. The information that n records add is computed from their
Jacobians H and covariances V at the present estimate. The point's unknown zero is eliminated by the Schur
complement:

    I = sum H^T V^-1 H - (sum H^T V^-1) (sum V^-1)^-1 (sum V^-1 H).
"""

import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hexacell.campaign.budget import Budget
from hexacell.campaign.decisions import CampaignState, Forecast
from hexacell.campaign.task_accuracy import Task, TaskError
from hexacell.campaign.time_model import TimeModel
from hexacell.design import candidates
from hexacell.design.candidates import ReachableTargets, reachable
from hexacell.design.criteria import D_OPTIMAL, add_information, covariance_update
from hexacell.design.pose_selection import SelectedPose
from hexacell.design.predicted_records import position_derivatives, with_terms
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array

SET_SIZES = (1, 2, 4, 8, 16, 32)
"""Numbers of records at a point whose gain is compared with their time."""


@dataclass(frozen=True, eq=False)
class Forecaster:
    """Forecasts the error at the task poses.

    Attributes:
        sizes: gives how many records each point gets at most, by what is known in a state.
        times: gives how long records take, likewise.
        planned_sets: gives a set of poses at each point, which represent those not selected yet.
        from_commands: gives commanded poses in the frame convention.
        systematic_mm: gives the standard uncertainty by the systematic effects at the end, if it is known.
    """

    sizes: Callable[[CampaignState], Mapping[int, int]]
    times: Callable[[CampaignState], TimeModel]
    budget: Budget
    task: Task
    planned_sets: Callable[[], Sequence[PoseBatch]]
    from_commands: Callable[[Iterable[Pose]], PoseBatch]
    systematic_mm: Callable[[], float | None]

    def worst_error(self, state: CampaignState, belief: RobotBelief) -> float | None:
        """The error at the worst task pose now, 1 sigma, mm; None without task poses."""
        error = self._error(state, belief)
        return None if error is None else error.worst(belief.covariance)

    def forecast(
        self, state: CampaignState, belief: RobotBelief, selected: SelectedPose | None = None
    ) -> Forecast | None:
        """The effect of a selected record and of completing the plan; None without task poses."""
        if (error := self._error(state, belief)) is None:
            return None
        now = after = error.worst(belief.covariance)
        if selected is not None:
            record = selected.record.jacobian[0], selected.record.covariance[0]
            after = error.worst(covariance_update(belief.joint_covariance, *record))
        planned = self.planned(state)
        end, records = error.worst(self._covariance_after(belief, state, planned)), sum(planned.values())
        return Forecast(
            now_mm=now,
            next_mm=after,
            # The planned sets may give less information than the record actually selected.
            end_mm=after if selected and records == 1 else min(end, after),
            records=records,
            minutes=self.times(state).minutes(records, len(set(planned) - {state.point})),
            systematic_mm=self.systematic_mm(),
        )

    def _error(self, state: CampaignState, belief: RobotBelief) -> TaskError | None:
        """The error at the end; with zeros alone by the records that there are and those planned."""
        if self.task.held is None:
            return self.task.error(belief)
        sets = self.planned_sets()
        planned = [sets[point - 1][:more] for point, more in self.planned(state).items()]
        measured = self.from_commands(record.pose for record in state.measurements.records)
        return self.task.error(belief, PoseBatch.joined([measured, *planned]))

    def planned(self, state: CampaignState) -> dict[int, int]:
        """How many more records each point will get, as far as the budget goes."""
        planned: dict[int, int] = {}
        records, points = len(state.measurements), state.begun_points
        # The present point comes first.
        left = sorted(set(self.sizes(state)) - state.done, key=lambda point: (point != state.point, point))
        for point in left:
            is_begun, more = state.point == point, self._most(state, point, records, points)
            if more >= (1 if is_begun else 2):
                planned[point] = more
                records, points = records + more, points + (not is_begun)
        return planned

    def best_point(self, state: CampaignState, belief: RobotBelief, points: Sequence[int]) -> int:
        """Which of some points takes most off the mean square error at the task poses in a minute."""
        if (error := self.task.error(belief)) is None:
            return points[0]
        error = TaskError(error.jacobian)  # that of all parameters, which records improve whatever is held
        information = PlannedInformation.of(self.sets_at(points), belief)
        covariance = belief.joint_covariance
        rates = [
            max(self._rates(state, covariance, information, error, point), default=-math.inf)
            for point in points
        ]
        return points[int(np.argmax(rates))]

    def predicted_belief(self, belief: RobotBelief, state: CampaignState) -> RobotBelief:
        """What will be known once everything that is still planned is measured."""
        return belief.knowing(self._covariance_after(belief, state, self.planned(state)))

    def known_beside_next(self, belief: RobotBelief, state: CampaignState) -> Array:
        """:attr:`.RobotBelief.joint_covariance` after all that is planned but the point's next record."""
        others = {point: more - (point == state.point) for point, more in self.planned(state).items()}
        return self._covariance_after(belief, state, others)

    def _covariance_after(
        self, belief: RobotBelief, state: CampaignState, planned: Mapping[int, int]
    ) -> Array:
        if not any(planned.values()):
            return belief.joint_covariance
        information = _planned_information(self, belief, frozenset(planned))
        added = [information.added(state, point, more) for point, more in planned.items()]
        return add_information(belief.joint_covariance, np.sum(added, axis=0))

    def sets_at(self, points: Container[int]) -> list[PoseBatch]:
        """The planned sets of some points, and empty ones of the others, which would only take time."""
        every = enumerate(self.planned_sets(), start=1)
        return [poses if point in points else poses[:0] for point, poses in every]

    def _rates(
        self,
        state: CampaignState,
        covariance: Array,
        information: "PlannedInformation",
        error: TaskError,
        point: int,
    ) -> Iterator[float]:
        """What different numbers of records at a point would take off the mean square, mm^2 a minute."""
        is_begun, times = state.point == point, self.times(state)
        most = self._most(state, point, len(state.measurements), state.begun_points)
        for size in sorted({min(size, most) for size in SET_SIZES} - ({0} if is_begun else {0, 1})):
            after = add_information(covariance, information.added(state, point, size))
            gained = error.mean_square(covariance) - error.mean_square(after)
            yield gained / times.minutes(size, 0 if is_begun else 1)

    def _most(self, state: CampaignState, point: int, records: int, points: int) -> int:
        """How many more records a point may get after some records at some points."""
        affordable = self.budget.records_left(records, points + (state.point != point), self.times(state))
        return int(min(self.sizes(state)[point] - state.records_at(point), affordable))


@dataclass(frozen=True, eq=False)
class PlannedInformation:
    """The records of a set of poses at each point, linearized.

    Attributes:
        jacobian: derivatives (n, 3, p + 6 m) of all sets' records by parameters and terms' coefficients.
        weights: inverse covariances of the records (n, 3, 3), 1/mm^2.
        bounds: (m + 1,) rows at which the sets begin, and the last one ends.
    """

    jacobian: Array
    weights: Array
    bounds: NDArray[np.intp]

    @classmethod
    def of(cls, sets: Sequence[PoseBatch], belief: RobotBelief) -> "PlannedInformation":
        """The records at the present estimate; poses it cannot reach are left out."""
        poses = PoseBatch.joined(sets)
        joints = belief.mechanism.inverse(belief.estimate, belief.branch, poses)
        rows = np.flatnonzero(np.isfinite(joints).all(axis=-1))
        reached = ReachableTargets(poses[rows], joints[rows])
        arrived = np.sign(np.diff(reached.joints, axis=0, prepend=reached.joints[:1]))  # one after another
        jacobian, by_joints = position_derivatives(belief, reached, arrived)
        ends = np.cumsum([len(poses) for poses in sets])
        return cls(jacobian, belief.noise.record_weights(by_joints), np.searchsorted(rows, [0, *ends]))

    def information(self, point: int, records: int) -> Array:
        """The information (p + 6 m, p + 6 m) of the first ``records`` of a point, counted from 1."""
        first, last = self.bounds[point - 1], self.bounds[point]
        rows = slice(int(first), int(min(first + max(records, 0), last)))
        jacobian, weights = self.jacobian[rows], self.weights[rows]
        size = self.jacobian.shape[-1]
        if len(jacobian) < 2:
            return np.zeros((size, size))
        weighted = weights @ jacobian
        total = weighted.sum(axis=0)
        mean = np.linalg.solve(weights.sum(axis=0), total)
        return np.asarray(jacobian.reshape(-1, size).T @ weighted.reshape(-1, size) - total.T @ mean)

    def added(self, state: CampaignState, point: int, records: int) -> Array:
        """The information that more records at a point add; those it has count for its zero only."""
        before = state.records_at(point)
        added = self.information(point, before + records)
        return added - self.information(point, before) if before else added


@lru_cache(maxsize=1)
def _planned_information(
    forecaster: Forecaster, belief: RobotBelief, points: frozenset[int]
) -> PlannedInformation:
    """The information of some points' planned sets; the last is kept, as a decision asks twice for it."""
    return PlannedInformation.of(forecaster.sets_at(points), belief)


def select_sets(
    drawn: RobotBelief, points: Array, records: int, seed: int, candidate_count: int
) -> tuple[PoseBatch, ...]:
    """Sets of ``records`` poses at ball positions (m, 3), mm, the reference first in each.

    In the mechanism's frame convention; empty where the robot cannot go.
    """
    limits = drawn.limits
    rotated = candidates.orientations(candidate_count, limits.tilt, seed, most_twist=limits.turn)
    orientations = limits.orientations(np.concatenate([np.eye(3)[None], rotated]))
    poses = (PoseBatch.at(point, orientations) for point in points)
    completed = (drawn.mechanism.completed(drawn.estimate, each) for each in poses)
    return tuple(_select(drawn, each, records) for each in completed)


def _select(drawn: RobotBelief, poses: PoseBatch, records: int) -> PoseBatch:
    """The first of the poses, then greedily those that gain most beside the ones selected."""
    targets, _ = reachable(drawn, poses)
    if not len(targets) or not np.array_equal(targets.poses.rotations[0], poses.rotations[0]):
        return poses[[]]
    selected = [0]
    jacobian, by_joints = position_derivatives(drawn, targets)
    free = jacobian[..., : len(drawn.free)]
    noise = drawn.noise.record_covariance(by_joints)
    noise = noise + noise[0]
    covariance = drawn.joint_covariance
    for _ in range(min(records, len(targets)) - 1):
        every = with_terms(drawn, free, targets, np.sign(targets.joints - targets.joints[selected[-1]]))
        change = every - every[0]
        gain = D_OPTIMAL.gain(covariance, change, noise)
        gain[selected] = -np.inf
        best = int(np.argmax(gain))
        selected.append(best)
        covariance = covariance_update(covariance, change[best], noise[best])
    return targets.poses[selected]
