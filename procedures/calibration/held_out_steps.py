"""The steps that measure the held-out points, before and after the new geometry is written."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hexacell.cell.model import CellSettings
from hexacell.experiment_design import candidates
from hexacell.experiment_design.validation_poses import select_validation_poses
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from procedures.calibration.set_steps import (
    SetSteps,
    TravelError,
    reference_move,
    reference_pose,
    require_zero,
)
from procedures.run.state import RunState
from procedures.run.steps import Compute, Locate, Move, Phase, SetKey, SixNumbers, Step


@dataclass(frozen=True, eq=False)
class HeldOutSteps:
    """Decides on the steps; poses are chosen among ``candidate_count`` orientations."""

    settings: CellSettings
    sets: SetSteps
    candidate_count: int

    def next_step(self, state: RunState, phase: Phase) -> Step | None:
        """The next step of the first set that is not closed; None if all are."""
        for point in range(1, len(self.settings.verification.points) + 1):
            key = SetKey(phase=phase, point=point)
            if not state.set(key).closed:
                return Locate() if state.position_unknown else self._in_set(state, key)
        return None

    def choose_poses(self, identified: Identification | None) -> tuple[tuple[SixNumbers, ...], ...]:
        """Poses at each held-out point, in the controller's frames.

        Raises:
            LimitError: a point has too few that keep the ball inside the travel.
        """
        verification, robot = self.settings.verification, self.sets.robot
        belief = robot.belief(identified)
        used = None if identified is None else identified.poses.rotations
        turns = candidates.orientations(self.candidate_count, belief.limits.tilt, verification.seed)
        chosen = []
        for point in verification.points:
            position = robot.from_commands([Pose(*point)]).positions[0]
            poses = select_validation_poses(belief, position, verification.orientations, turns, used)
            commands = (robot.to_command(poses.pose(row)) for row in range(len(poses)))
            chosen.append(tuple(command.as_tuple() for command in commands))
        return tuple(chosen)

    @cached_property
    def _poses_by_drawing(self) -> tuple[tuple[SixNumbers, ...], ...]:
        """The poses of a run that identifies nothing."""
        return self.choose_poses(None)

    def _in_set(self, state: RunState, key: SetKey) -> Step:
        measured = state.set(key)
        if measured.rejections and key.phase is Phase.AFTER:
            return Compute(kind="judge")
        require_zero(state, key)
        if measured.rejections:
            raise TravelError(f"{key}: the ball left the gauges' travel at a held-out pose")
        if measured.reference_unverified:
            return self.sets.at_reference(state, key) or self._to_reference(state, key)
        if len(measured.samples) < self.settings.verification.orientations:
            return self.sets.at_pose(state, key) or self._to_next_pose(state, key)
        if step := self.sets.at_reference(state, key):
            return step
        # The poses were chosen with a safe straight line back from each of them.
        is_in_order = self.sets.paths.is_in_order(state, key)
        return reference_move(state, key) if is_in_order else self._to_reference(state, key)

    def _to_next_pose(self, state: RunState, key: SetKey) -> Move:
        poses = state.identified.held_out if state.identified else self._poses_by_drawing
        orientation = state.set(key).next_orientation
        move = Move(at=key, orientation=orientation, pose=poses[key.point - 1][orientation - 1])
        if orientation == 1:
            return self.sets.paths.towards(state, move)
        if state.at_pose == (key, orientation - 1):  # the poses were chosen with safe lines between them
            return move
        return self.sets.paths.towards(state, move, self._ball(state, key))

    def _to_reference(self, state: RunState, key: SetKey) -> Move:
        return self.sets.to_reference(state, key, self._ball(state, key))

    def _ball(self, state: RunState, key: SetKey) -> Array | None:
        """Where the ball is at the set's reference (3,), mm, by what is known now."""
        return self.sets.paths.ball_at(state, reference_pose(state, key))
