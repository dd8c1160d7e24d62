"""What the best test could do: the chances to refuse a robot with a fault, and to name its leg.

A robot outside its tolerances is a distance d from the nearest one inside, in standard deviations of what
records tell. The best test of one against the other, which calls the one inside faulty with probability p,
finds the fault with the chance Phi(d - z), z the quantile of 1 - p (Neyman and Pearson); no test of all
robots inside does better. Likewise two robots with faults in different legs are told apart with the chance
Phi(d / 2), where one is as likely as the other.
"""

import numpy as np
from scipy.special import ndtr, ndtri

from hexacell.identification.diagnostics.tolerance_check import PROBABILITY, ToleranceFitter
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import Robot

LEAST_INFORMATION = 1e-6
"""Of what the prior has: where the records have none."""


def largest_chances(robot: Robot, known: Identification, built: Geometry, leg: int) -> tuple[float, float]:
    """To refuse a robot that is known as well as another one, and to name its faulty leg.

    ``built`` is in the mechanism's frame convention.
    """
    mechanism = robot.mechanism
    basis = mechanism.convention.basis
    information = known.solution.information + LEAST_INFORMATION * robot.prior.precision
    covariance = basis @ np.linalg.inv(information) @ basis.T
    fitter = ToleranceFitter(mechanism, robot.drawing, robot.tolerances, built, covariance)
    inside = fitter.fit(mechanism.normalize_frames(robot.drawing)[1].inverse())
    refused = float(ndtr(np.sqrt(inside.distance) + ndtri(PROBABILITY)))
    parameters = mechanism.parameters
    joints = {(one.kind, one.leg) for one in parameters.parameters if one.leg != leg}
    others = [
        fitter.fit(
            inside.frames,
            [row for row, one in enumerate(parameters.parameters) if (one.kind, one.leg) == joint],
        )
        for joint in joints
    ]
    nearest = min(other.distance for other in others)
    return refused, min(refused, float(ndtr(0.5 * np.sqrt(nearest))))
