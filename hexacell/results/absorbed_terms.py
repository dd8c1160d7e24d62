"""A geometry for a controller that cannot correct what is not geometry: it does as much of that as it can.

Over the workspace what a leg yields, and part of what play does, is nearly what another geometry would do.
The controller gets the geometry whose poses are nearest to those commanded, with base and platform frames
fitted; by the drawing's tolerances it is kept from growing without bounds.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.identification.diagnostics.pose_accuracy import error_jacobian, teachable_frames
from hexacell.identification.problem.prior import Prior
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot
from hexacell.uncertainty.propagation import errors_by_term, placement_of

WANTED_MM = 0.02
"""How near the poses are to be, beside how far parameters go from what was identified."""


def absorbing(
    settings: CellSettings, robot: Robot, identified: Geometry, left: Mapping[str, Array]
) -> Geometry:
    """The geometry that does most of what is left of some terms, in the mechanism's frame convention.

    Args:
        settings: of the cell.
        robot: with the terms that it may have.
        identified: the robot's geometry.
        left: coefficients (6,) that the controller does not correct, by the names of the terms.
    """
    terms = [term for term in robot.terms if term.name in left and not term.needs_directions]
    convention = robot.mechanism.convention
    belief = replace(robot.belief(), free=convention.free_parameters(identified))
    task = Task.of(settings, robot, belief).reachable(belief)
    if not terms or not len(task.poses) or not len(task.workspace):
        return identified
    poses, frames = PoseBatch.joined([task.poses, task.workspace]), teachable_frames(belief, task.workspace)
    errors = np.zeros((len(poses), 6))
    at_task, over = placement_of(belief, poses), placement_of(belief, task.workspace)
    for term in terms:
        errors = errors + errors_by_term(term, frames, at_task, over) @ left[term.name]
    radius = float(robot.mechanism.platform_radius(identified))
    weights = np.repeat([1.0, radius], 3) / WANTED_MM
    rows = (weights[:, None] * error_jacobian(belief, poses, task.workspace)).reshape(-1, len(belief.free))
    normal = rows.T @ rows + Prior.of(robot.mechanism, robot.drawing, robot.tolerances).precision
    # A controller with parameters larger by dp brings the robot -J dp beside where it would be.
    change = np.linalg.solve(normal, rows.T @ (weights * errors).reshape(-1))
    return convention.geometry(belief.free + change)
