"""The held-out poses of a calibration, in the controller's frames.

Before the write-back only poses can be taken at which the ball stays inside the travel although the
geometry is wrong. Afterwards these are taken again, for the comparison, and then poses as wide as the
robot's limits, since a geometry may be right at small tilts alone. Where a test of the model fails
narrowly, confirming ones follow, at the same points.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.campaign.held_out_sets import held_out_sets, held_out_turns
from hexacell.cell.model import CellSettings
from hexacell.design.validation_poses import select_validation_poses
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.results.term_result import term_results
from hexacell.results.written_geometry import as_written
from hexacell.robot.model import Robot
from procedures.calibration.calibration import Knowledge
from procedures.run.keys import SixNumbers
from procedures.run.state import RunState

CONFIRMING_SEED = 1_000_003
"""Added to the seed of the held-out orientations for those that confirm a failure."""

PosesByPoint = tuple[tuple[SixNumbers, ...], ...]
"""Poses at each held-out point, its reference first; empty at a point that is left."""


@dataclass(frozen=True, eq=False)
class HeldOutPoses:
    """Chooses the poses for a robot with some geometry in its controller, of so many candidates."""

    settings: CellSettings
    robot: Robot
    candidate_count: int

    def before(self, identified: Identification) -> PosesByPoint:
        """Poses that are measured before the write-back as well; a point with too few is left.

        Raises ``LimitError`` if all points are.
        """
        count = self.settings.verification.compared
        sets = [*held_out_sets(self.robot, self.settings, identified, self._turns(), count)]
        failures = [one for one in sets if isinstance(one, LimitError)]
        if len(failures) == len(sets):
            raise failures[0]
        return tuple(() if isinstance(one, LimitError) else self._commands(one) for one in sets)

    def after(self, identified: Identification, before: PosesByPoint) -> PosesByPoint:
        """Others at the points of those measured ``before``, which they follow, without references."""
        belief, turns, used = self.robot.belief(identified), self._turns(), identified.poses.rotations
        return tuple(self._at(poses, belief, turns, used, poses[-1:])[1:] for poses in before)

    def confirming(
        self, identified: Identification, before: PosesByPoint, after: PosesByPoint
    ) -> PosesByPoint:
        """Once more others, which are unlike those ``after``; each point has its reference among them."""
        belief, turns = self.robot.belief(identified), self._turns(CONFIRMING_SEED)
        taken = self.robot.from_commands(Pose(*pose) for poses in after for pose in poses)
        used = np.concatenate([identified.poses.rotations, taken.rotations])
        return tuple(self._at(poses, belief, turns, used) for poses in before)

    def _at(
        self,
        chosen: Sequence[SixNumbers],
        belief: RobotBelief,
        turns: Array,
        used: Array,
        coming_from: Sequence[SixNumbers] = (),
    ) -> tuple[SixNumbers, ...]:
        """Poses at the point of some; empty where these are, or the robot has too few others."""
        if not chosen:
            return ()
        point = self.robot.from_commands([Pose(*chosen[0])]).positions[0]
        here = self.robot.from_commands(Pose(*pose) for pose in coming_from) if coming_from else None
        count = self.settings.verification.orientations
        try:
            return self._commands(select_validation_poses(belief, point, count, turns, used, here))
        except LimitError:
            return ()

    def _turns(self, added_seed: int = 0) -> Array:
        return held_out_turns(self.robot, self.settings, self.candidate_count, added_seed)

    def _commands(self, poses: PoseBatch) -> tuple[SixNumbers, ...]:
        commands = (self.robot.to_command(poses.pose(row)) for row in range(len(poses)))
        return tuple(command.as_tuple() for command in commands)


def poses_before(known: Knowledge, identified: Identification) -> PosesByPoint:
    """Held-out poses that are measured before the write-back; raises ``LimitError`` if there are none."""
    return _chooser(known, known.plan.robot).before(identified)


def poses_after(known: Knowledge, identified: Identification, before: PosesByPoint) -> PosesByPoint:
    """Held-out poses that the robot can take once the identified geometry is written."""
    zeros = known.robot.identified_zeros(identified)
    geometry, terms = (zeros or identified).geometry, term_results(identified)
    written = as_written(known.settings, known.robot, geometry, terms)
    after = known.robot.with_controller(written.geometry, written.corrections)
    return _chooser(known, after).after(identified, before)


def confirming_poses(known: Knowledge, identified: Identification, state: RunState) -> PosesByPoint:
    """Held-out poses unlike all that were measured, to confirm a failure."""
    found = state.identified
    assert found is not None  # noqa: S101 - callers have a result
    chooser = _chooser(known, known.measuring.robot)
    return chooser.confirming(identified, found.held_out, found.held_out_after)


def held_out_replacements(
    known: Knowledge, identified: Identification, state: RunState
) -> Iterator[tuple[SixNumbers, SixNumbers]]:
    """Held-out poses that the controller refuses, each with another one, in the controller's frames.

    Those that were measured before the write-back are not replaced after it: both are compared. A point
    with too few others keeps what is left of its own, and one whose reference is refused is left.
    """
    found, replaced = state.identified, []
    assert found is not None  # noqa: S101 - its poses are held out of an identification
    if state.committed is None:
        others = _chooser(known, known.plan.robot).after(identified, found.held_out)
        replaced.append((found.held_out, others))
    if found.held_out_after:
        replaced.append((found.held_out_after, poses_after(known, identified, found.held_out)))
    for present, others in replaced:
        for before, poses, chosen in zip(found.held_out, present, others, strict=True):
            if before and state.refused.allows(before[0]):
                left_out = (pose for pose in poses if not state.refused.allows(pose))
                yield from zip(left_out, (pose for pose in chosen if pose not in poses), strict=False)


def _chooser(known: Knowledge, robot: Robot) -> HeldOutPoses:
    return HeldOutPoses(known.settings, robot, known.calibration.effort.held_out_candidates)
