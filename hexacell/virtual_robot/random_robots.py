"""Random geometries: robots as they may have been built."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.geometry import PARAMETER_NAMES, Geometry
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
    return Geometry.from_vector(
        mechanism.convention.basis() @ (free + random.uniform(-error_mm, error_mm, len(free)))
    )


def robots_within_tolerances(robot: Robot, count: int, seed: int) -> list[Geometry]:
    """Geometries in the frame convention, with errors uniform within the tolerances.

    A controller whose geometry is not the drawing's was calibrated before. Then errors are a share of
    the tolerances, about the controller's geometry.
    """
    random = np.random.default_rng(seed)
    convention, tolerances = robot.mechanism.convention, robot.tolerances
    names = convention.free_names()
    widths = tolerances.widths()[[PARAMETER_NAMES.index(name) for name in names]]
    of_ball = np.array([[name[0] == "B" and name[-1] == axis for name in names] for axis in "xyz"])
    centre = convention.free_parameters(robot.commanding)
    as_drawn = np.abs(centre - convention.free_parameters(robot.prior.centre)).max() < AS_DRAWN_MM
    share = 1.0 if as_drawn else WEAR_SHARE
    geometries = []
    for _ in range(count):
        ball = random.uniform(-tolerances.ball_mm, tolerances.ball_mm, 3)
        free = centre + share * (random.uniform(-widths, widths) + ball @ of_ball)
        geometries.append(Geometry.from_vector(convention.basis() @ free))
    return geometries
