"""What to do next: the whole procedure as a decision on where the run stands.

Points one after the other, each with a reference where the gauges are zeroed and orientations that
choose themselves from what is known by then; then the geometry is identified and the held-out
points are visited; the geometry is written back, and the held-out points are visited again.
Nothing here talks to hardware or disk, so the same decisions serve a run, its resumption and its
replay.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.design import candidates
from hexacell.design.held_out import choose_held_out
from hexacell.design.knowledge import Knowledge
from hexacell.design.next_pose import Choice, Station, choose, station
from hexacell.design.path import is_clear
from hexacell.errors import HexacellError, LimitError
from hexacell.identification.estimate import identify, track
from hexacell.identification.result import Identification
from hexacell.pose import Pose, Poses
from hexacell.robot import Robot
from hexacell.rotations import Array
from hexacell.verification import Verdict
from procedures.events import Sampled
from procedures.state import RunState, SetState
from procedures.steps import (
    CloseSet,
    Compute,
    Expectation,
    Move,
    Phase,
    Place,
    Sample,
    SetKey,
    SixNumbers,
    Step,
)

CANDIDATES = 512
HELD_OUT_CANDIDATES = 2048
REFUSALS = 3
"""Records of one point that may leave the travel before the point is given up."""


class Mode(StrEnum):
    """What a run is for."""

    OPTIMISE = "optimise"
    CHECK = "check"


def expected_records(settings: CellSettings, mode: Mode) -> int:
    """How many times a whole run waits for settled readings, closings of sets included."""
    identification, verification = (
        len(size.points) * (size.orientations + 1)
        for size in (settings.identification, settings.verification)
    )
    return verification if mode is Mode.CHECK else identification + 2 * verification


@dataclass(frozen=True, eq=False)
class Calibration:
    """The procedure of one cell."""

    settings: CellSettings
    robot: Robot
    mode: Mode

    def next_step(self, state: RunState) -> Step | None:
        """The step to do where the run stands; nothing when it is over."""
        if state.ended is not None:
            return None
        if self.mode is Mode.CHECK:
            return self._measuring(state, Phase.BEFORE) or (None if state.judged else Compute(kind="judge"))
        return (
            self._measuring(state, Phase.IDENTIFY)
            or (None if state.identified else Compute(kind="identify"))
            or self._measuring(state, Phase.BEFORE)
            or self._writing_back(state)
        )

    def identification(self, state: RunState) -> Identification:
        """The geometry that the run's records give.

        Raises:
            IdentifiabilityError: they cannot give one.
        """
        return identify(self.robot.problem(state.measurements()))

    def held_out_poses(self, identified: Identification | None) -> tuple[tuple[SixNumbers, ...], ...]:
        """Poses at each held-out point, in the controller's frames.

        Raises:
            LimitError: a point has too few that keep the ball inside the travel.
        """
        verification = self.settings.verification
        knowledge = self.robot.knowledge(identified)
        turns = candidates.orientations(HELD_OUT_CANDIDATES, knowledge.limits.tilt, verification.seed)
        chosen = []
        for point in verification.points:
            position = self.robot.change.poses(Poses.of([Pose(*point)])).positions[0]
            poses = choose_held_out(knowledge, position, verification.orientations, turns)
            chosen.append(
                tuple(self.robot.to_command(poses.pose(row)).as_tuple() for row in range(len(poses)))
            )
        return tuple(chosen)

    def _writing_back(self, state: RunState) -> Step | None:
        if state.proposed is None:
            return Compute(kind="propose")
        if state.judged is None:
            if state.committed is None:
                return Compute(kind="commit")
            return self._measuring(state, Phase.AFTER) or Compute(kind="judge")
        if state.judged.verdict is not Verdict.PASS and not state.rolled_back:
            return Compute(kind="roll back")
        return None

    def _measuring(self, state: RunState, phase: Phase) -> Step | None:
        """The next step of the first set of a phase that is not closed."""
        size = self.settings.identification if phase is Phase.IDENTIFY else self.settings.verification
        for point in range(1, len(size.points) + 1):
            key = SetKey(phase=phase, point=point)
            if not state.set(key).closed:
                return self._next_in_set(state, key, size.orientations)
        return None

    def _next_in_set(self, state: RunState, key: SetKey, orientations: int) -> Step:
        measured = state.set(key)
        if measured.refusals and key.phase is Phase.AFTER:
            return Compute(kind="judge")
        if not measured.samples and measured.refusals:
            raise LimitError(f"{key}: the gauges cannot be zeroed, they are at the end of their travel")
        if measured.refusals and key.phase is Phase.BEFORE:
            raise LimitError(f"{key}: the ball left the gauges' travel at a held-out pose")
        if len(measured.samples) < orientations and measured.refusals <= REFUSALS:
            move = self._standing_move(state, key) or self._move(state, key)
            if move is not None:
                return move
        return self._closing(state, key)

    def _standing_move(self, state: RunState, key: SetKey) -> Step | None:
        """What to do at the pose the robot was just sent to: place the gauges, or sample."""
        orientation = len(state.set(key).samples) + 1
        if state.standing != (key, orientation) or state.target is None:
            return None
        if orientation == 1 and not state.set(key).placed:
            return Place(at=key, pose=state.target)
        return Sample(at=key, orientation=orientation, pose=state.target)

    def _closing(self, state: RunState, key: SetKey) -> Step:
        if state.standing == (key, 1):
            return CloseSet(at=key)
        orientation = self._on_the_way_back(state, key)
        return Move(at=key, orientation=orientation, pose=state.set(key).samples[orientation - 1].pose)

    def _on_the_way_back(self, state: RunState, key: SetKey) -> int:
        """The set's first orientation, or the earliest that a safe straight line leads to from here.

        The last resort is the one before: the line between the two was safe when it was chosen.
        """
        if key.phase is not Phase.IDENTIFY:
            return 1  # held-out poses were chosen with a safe way back
        samples = state.set(key).samples
        at_set, here = state.standing or (key, 0)
        last = here - 1 if at_set == key and here > 1 else len(samples)
        try:
            knowledge, at = self._known(state, key)
        except HexacellError:
            return last
        present = self._present(state, samples)
        for orientation in range(1, last):
            if is_clear(knowledge, present, self._held(samples[orientation - 1].pose), at.reference):
                return orientation
        return last

    def _move(self, state: RunState, key: SetKey) -> Move | None:
        """The move to the set's next orientation; none if there is none worth or safe to visit."""
        measured = state.set(key)
        if key.phase is not Phase.IDENTIFY:
            return self._held_out_move(state, key, measured)
        if not measured.samples:
            point = self.settings.identification.points[key.point - 1]
            return Move(at=key, orientation=1, pose=(*point, 0.0, 0.0, 0.0))
        try:
            choice = self._choice(state, key)
        except LimitError:
            return None
        return Move(
            at=key,
            orientation=len(measured.samples) + 1,
            pose=self.robot.to_command(choice.command).as_tuple(),
            expected=self._expectation(choice),
        )

    @cached_property
    def _poses_to_check(self) -> tuple[tuple[SixNumbers, ...], ...]:
        """Held-out poses of a run that identifies nothing: what the drawing alone makes safe."""
        return self.held_out_poses(None)

    def _held_out_move(self, state: RunState, key: SetKey, measured: SetState) -> Move:
        poses = state.identified.held_out if state.identified else self._poses_to_check
        orientation = len(measured.samples) + 1
        return Move(at=key, orientation=orientation, pose=poses[key.point - 1][orientation - 1])

    def _choice(self, state: RunState, key: SetKey) -> Choice:
        measured = state.set(key)
        knowledge, at = self._known(state, key)
        turns = candidates.orientations(CANDIDATES, knowledge.limits.tilt, self._seed(key, measured))
        return choose(knowledge, at, turns, self._present(state, measured.samples))

    def _known(self, state: RunState, key: SetKey) -> tuple[Knowledge, Station]:
        """The estimate by now, and where it says the ball was when the set's gauges were zeroed.

        Raises:
            LimitError: it cannot say so.
        """
        estimate = track(self.robot.problem(state.measurements()))
        knowledge = self.robot.knowledge(estimate)
        records = estimate.problem
        rows = np.flatnonzero(records.labels[:, 0] == key.point)
        if not len(rows):
            raise LimitError("the records of this point say nothing about where the ball is")
        return knowledge, station(
            knowledge, estimate.poses[rows], records.joints[rows], records.deviations[rows]
        )

    def _present(self, state: RunState, samples: tuple[Sampled, ...]) -> Poses:
        """The pose that the robot holds, that of a refused record included."""
        return self._held(state.target or samples[-1].pose)

    def _held(self, pose: SixNumbers) -> Poses:
        """A commanded pose in the convention's frames."""
        return self.robot.change.poses(Poses.of([Pose(*pose)]))

    def _seed(self, key: SetKey, measured: SetState) -> int:
        """Other candidates for every record and every attempt, and the same when done again."""
        attempt = len(measured.samples) + 100 * measured.refusals
        return self.settings.identification.seed + 1000 * key.point + attempt

    def _expectation(self, choice: Choice) -> Expectation:
        base = self.robot.change.base.T
        covariance = base @ np.diag(choice.sigma**2) @ base.T
        return Expectation(
            deviation_mm=_three(base @ choice.deviation),
            sigma_mm=_three(np.sqrt(np.diag(covariance))),
            gain=choice.gain,
        )


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
