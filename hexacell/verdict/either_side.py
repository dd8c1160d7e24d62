"""Task poses at which nobody knows on which side of their play some legs lie."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hexacell.cell.fields import Frozen, SixNumbers
from hexacell.identification.diagnostics.pose_accuracy import placement_of
from hexacell.identification.terms.play import WRONG_SIDE

if TYPE_CHECKING:
    from hexacell.campaign.task_accuracy import Task
    from hexacell.identification.belief import RobotBelief
    from hexacell.robot.model import Robot


class EitherSide(Frozen):
    """A pose at which the platform may lie in two places, as the weight hardly loads a leg.

    Attributes:
        pose: in the controller's frames.
        legs: that lie on other sides in the other place, from 1.
        apart_mm: how far the ball is from one place to the other.
    """

    pose: SixNumbers
    legs: tuple[int, ...]
    apart_mm: float


def places_on_either_side(robot: Robot, belief: RobotBelief, task: Task) -> tuple[EitherSide, ...]:
    """The other places that the platform may have at poses of a task within reach, the farthest first."""
    if belief.terms is None:
        return ()
    at, found = placement_of(belief, task.poses), list[EitherSide]()
    for term in belief.terms.terms:
        if term.on_either_side is None or term.needs_directions:
            continue
        sizes, _ = belief.terms.of(term.name)
        errors = term.on_either_side(at, np.zeros_like(at.joints), sizes) / WRONG_SIDE
        apart = np.linalg.norm(at.by_constraints[:, :3] @ errors, axis=1)
        for row, place in np.argwhere(apart > 0.0).tolist():
            pose = robot.to_command(task.poses.pose(row)).as_tuple()
            legs = tuple((1 + np.flatnonzero(errors[row, :, place])).tolist())
            found.append(EitherSide(pose=pose, legs=legs, apart_mm=float(apart[row, place])))
    return tuple(sorted(found, key=lambda one: -one.apart_mm))
