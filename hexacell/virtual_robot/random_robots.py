"""Random geometries: robots as they may have been built."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.robot_model import Robot

AS_DRAWN_MM = 1e-3
"""A controller whose parameters differ less from the drawing has the drawing's geometry."""

WEAR_SHARE = 0.1
"""Of the tolerances: how far a robot may have drifted since it was calibrated."""


def random_robot(
    mechanism: Mechanism, drawing: Geometry, error_mm: float, random: np.random.Generator
) -> Geometry:
    """A geometry in the frame convention, each free parameter uniform within ``error_mm``.

    As in Table 1 of Abtahi et al. 2010 (section 3.1, +-7 mm).
    """
    free = mechanism.convention.free_parameters(drawing)
    return mechanism.convention.geometry(free + random.uniform(-error_mm, error_mm, len(free)))


def robots_within_tolerances(robot: Robot, count: int, seed: int) -> list[Geometry]:
    """Geometries in the frame convention, with errors uniform within the tolerances.

    A controller whose geometry is not the drawing's was calibrated before. Then errors are a share of
    the tolerances, about the controller's geometry.
    """
    random = np.random.default_rng(seed)
    convention, tolerances = robot.mechanism.convention, robot.tolerances
    parameters, rows = convention.parameters, convention.free_rows()
    widths = tolerances.widths(parameters)[rows]
    centre = convention.free_parameters(robot.commanding)
    as_drawn = np.abs(centre - convention.free_parameters(robot.prior.centre)).max() < AS_DRAWN_MM
    share = 1.0 if as_drawn else WEAR_SHARE
    geometries = []
    for _ in range(count):
        ball = random.uniform(-tolerances.ball_mm, tolerances.ball_mm, 3)
        free = centre + share * (random.uniform(-widths, widths) + ball @ parameters.ball_offset[:, rows])
        geometries.append(convention.geometry(free))
    return geometries
