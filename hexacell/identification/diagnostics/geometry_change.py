"""How much a geometry differs from another one, in the frames in which it differs least.

The frames of base and platform are chosen, not measured: in others the same robot has other numbers. In the
frames of the convention a robot within tolerances of 7 mm differs by up to 30 mm from its drawing, because
the few joints that define them are off as well. The frames are therefore fitted to all parameters, each in
units of its tolerance, by Gauss-Newton steps; and where the ball may be mounted elsewhere, its offset.
"""

import numpy as np

from hexacell.identification.diagnostics.tolerance_check import ToleranceFitter, small_change
from hexacell.identification.problem.prior import Tolerances
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism

STEPS = 5
"""Turns of some degrees need three."""


def largest_change(
    mechanism: Mechanism, before: Geometry, geometry: Geometry, tolerances: Tolerances
) -> float:
    """The largest change of a parameter, mm, or mrad of an angle, in the best choice of frames.

    From a geometry ``before`` in its own frames to one in the mechanism's convention; infinite where that
    is not a number. Changes of different parameters are compared by the ``tolerances``.
    """
    if not np.isfinite(geometry.vector).all():
        return float("inf")
    count = len(before.vector)
    fitter = ToleranceFitter(mechanism, before, tolerances, geometry, np.zeros((count, count)))
    frames = mechanism.normalize_frames(before)[1].inverse()
    coordinates, turned = 3 if tolerances.ball_mm else 0, len(mechanism.frame_freedom.columns)
    ball = (before.parameters.ball_offset.T / fitter.widths[:, None])[:, :coordinates]
    offset = np.zeros(coordinates)
    for _ in range(STEPS):
        moving, difference = fitter.by_frames(frames), fitter.difference(frames) + ball @ offset
        solved = np.linalg.lstsq(np.hstack([moving, ball]), -difference, rcond=None)[0]
        step = np.zeros(9)
        step[mechanism.frame_freedom.columns] = solved[:turned] * fitter.frame_scales
        frames, offset = frames.then(small_change(step)), offset + solved[turned:]
    differences = fitter.difference(frames) + ball @ offset
    return float(np.abs(differences * fitter.widths / before.parameters.like_a_mm).max())
