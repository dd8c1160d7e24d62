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
from hexacell.identification.diagnostics.pose_accuracy import (
    error_jacobian,
    errors_by_terms,
    placement_of,
    teachable_frames,
)
from hexacell.identification.problem.prior import Prior
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.corrections import NO_CORRECTIONS
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot
from hexacell.uncertainty.statement import TaskErrors

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
    at_task, over = placement_of(belief, poses), placement_of(belief, task.workspace)
    coefficients = np.concatenate([left[term.name] for term in terms])
    errors = errors_by_terms(terms, frames, at_task, over) @ coefficients
    weights = np.repeat([1.0, float(robot.mechanism.platform_radius(identified))], 3) / WANTED_MM
    rows = (weights[:, None] * error_jacobian(belief, poses, task.workspace)).reshape(-1, len(belief.free))
    normal = rows.T @ rows + Prior.of(robot.mechanism, robot.drawing, robot.tolerances).precision
    # A controller with parameters larger by dp brings the robot -J dp beside where it would be.
    change = np.linalg.solve(normal, rows.T @ (weights * errors).reshape(-1))
    return convention.geometry(belief.free + change)


def errors_of_geometry_alone(
    settings: CellSettings, robot: Robot, found: Identification
) -> TaskErrors | None:
    """The errors at the task poses with the best geometry, if the controller corrected nothing else.

    None where it does not, or the robot can reach no task pose.
    """
    if found.terms is None or robot.corrections.are_none:
        return None
    coefficients = {term.name: found.terms.of(term.name)[0] for term in found.terms.terms}
    geometry = absorbing(settings, robot, found.geometry, coefficients)
    belief = replace(robot.belief(found), corrections=NO_CORRECTIONS)
    budget = Task.of(settings, robot, belief).budget(found, belief, robot.effects, robot.known_effects)
    if budget is None:
        return None
    return budget.errors_of(robot.mechanism.convention.free_parameters(geometry) - found.free)
