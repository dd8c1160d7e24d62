"""From which side joints arrive: the direction of the last way of each, if it was long enough.

A joint with lost motion stands still after a reversal until its encoder has gone as far as that. Where it
stands is known after a way in one direction that is certainly longer, whatever came before.
"""

from collections.abc import Sequence

import numpy as np

from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import Directions

UNKNOWN: Directions = ()

SURE_WAY = {JointUnit.MM: 0.3, JointUnit.DEG: 0.1}
"""A way after which a joint has gone through its lost motion.

Machines without preloaded screws lose 0.02 to 0.1 mm; three times that is left behind by nearly every move
between poses that tell something. In deg it is about the same at a radius of 200 mm.
"""

STOPS = 5.0
"""Standard deviations of a stop that a way must exceed: a joint that stops beside its command, once at
either end, and perhaps creeps there, has gone in the direction of the command all the same."""

STILL_SHARE = 1e-3
"""Share of a sure way within which a joint counts as standing still. It may be that far from the side on
which it lies, 0.3 um, and rounding is much less."""


def least_way(unit: JointUnit, stops: float) -> float:
    """The shortest way that says from which side a joint arrived, in its unit.

    ``stops`` is one standard deviation of where it stops beside its command.
    """
    return max(SURE_WAY[unit], STOPS * stops)


def arrival_directions(joints: Array, before: Sequence[int], least: float) -> Directions:
    """Whether each joint moved up, 1, or down, -1, at the end of a move; 0 where that is not known.

    A joint that has gone less than ``least`` since its last reversal, or since the move began, may be
    anywhere within its lost motion. It lies as before only if it went further the same way, or not at all.

    Args:
        joints: (k, J) along the move, in their unit, so densely that reversals between rows are small.
        before: the directions in which the joints had arrived where the move begins; empty: not known.
        least: as of :func:`least_way`.
    """
    if not np.isfinite(joints).all():  # somewhere no joint variables belong to the line
        return (0,) * int(joints.shape[1])
    return tuple(
        _direction([float(value) for value in way], one, least)
        for way, one in zip(joints.T, before or (0,) * joints.shape[1], strict=True)
    )


def _direction(way: Sequence[float], before: int, least: float) -> int:
    """The direction in which one joint arrives."""
    still = STILL_SHARE * least
    begin = farthest = way[0]
    sign, has_turned = 0, False
    for value in way:
        if sign == 0:
            if abs(value - begin) > still:
                sign, farthest = int(np.sign(value - begin)), value
        elif sign * (value - farthest) >= 0.0:
            farthest = value
        elif sign * (farthest - value) > still:
            begin, farthest, sign, has_turned = farthest, value, -sign, True
    if abs(farthest - begin) >= least:
        return sign
    return before if not has_turned and sign in (0, before) else 0
