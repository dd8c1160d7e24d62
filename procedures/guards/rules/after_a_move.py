"""Rules that are evaluated once, after a move: where the joints are, and whether each gauge moved."""

import numpy as np

from hexacell.kinematics.mechanism import MechanismWords
from hexacell.kinematics.rotations import Array
from procedures.guards.rules.base import MAX_GARBLED, joint_trip
from procedures.run.trips import Guard, Trip

STUCK_GAUGE_MM = 1.0
"""A gauge is stuck if its display did not change over an expected displacement larger than this."""


def following_error(commanded: Array, measured: Array, limit: float, of: MechanismWords) -> Trip | None:
    """After a move: a joint (6,) is too far from its commanded position; ``of`` has its word and unit."""
    unit = of.joint_unit
    words = f"is {{:+.3f}} {unit} from its commanded position (limit {limit:g} {unit})"
    return joint_trip(of.joint, np.subtract(measured, commanded), limit, words)


def stuck_gauge(gauge: str, displayed: tuple[str, ...], expected_mm: float) -> Trip | None:
    """After a move: a gauge displayed one value all the time although its ball must have moved."""
    if len(displayed) < MAX_GARBLED or len(set(displayed)) > 1 or abs(expected_mm) <= STUCK_GAUGE_MM:
        return None
    return Trip(
        Guard.STALE,
        gauge,
        f"shows {displayed[0]} unchanged although the ball should have moved {expected_mm:+.2f} mm",
        "See whether its plunger is free and its display alive, then resume",
    )
