"""Effects of the environment: temperature and load.

A temperature that differs from that of the measuring changes every length of a part by its coefficient of
expansion; the encoders' scales expand with the base that they are fixed to. A force on the tool that was
not there while measuring shortens the legs, each by its share of the force and its compliance.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import UM, Effect, Occurrence, Placement

UM_PER_M = 1e-6
"""A relative expansion."""


def temperature_at_work(kelvin: float, um_per_m_k: Mapping[MachinePart, float], source: str = "") -> Effect:
    """The whole machine is warmer at work than it was while measuring."""

    def expansion(placement: Placement) -> Array:
        return _warmer(placement, um_per_m_k)

    return Effect("temperature at work", kelvin, "K", Occurrence.AT_WORK, expansion, source=source)


def temperature_while_measuring(
    kelvin: float, um_per_m_k: Mapping[MachinePart, float], source: str = ""
) -> Effect:
    """The whole machine becomes warmer by this much from the first record to the last, evenly."""

    def expansion(placement: Placement) -> Array:
        progress = np.linspace(-0.5, 0.5, len(placement))
        return progress[:, None, None] * _warmer(placement, um_per_m_k)

    name = "temperature while measuring"
    return Effect(name, kelvin, "K", Occurrence.MEASURING, expansion, source=source)


def load_at_work(newton: float, um_per_n: float, source: str = "") -> Effect:
    """A force on the tool in any direction; ``um_per_n`` is the compliance of a leg with its joints."""

    def bending(placement: Placement) -> Array:
        # Virtual work: leg forces t hold a force F on the platform if J^T t = F. With A = -J^-1 the legs
        # yield by c t, and the platform by c A A^T F.
        inverse = placement.by_constraints
        bent: Array = UM * um_per_n * inverse @ np.swapaxes(inverse[:, :3], -1, -2)
        return bent

    return Effect("load at work", newton, "N", Occurrence.AT_WORK, bending, source=source)


def _warmer(placement: Placement, um_per_m_k: Mapping[MachinePart, float]) -> Array:
    """Errors of the poses (n, 6, 1) by one kelvin."""
    parameters = placement.mechanism.parameters
    coefficients = {kind.symbol: um_per_m_k[kind.part] if kind.part else 0.0 for kind in parameters.kinds}
    changes = parameters.by_kind(coefficients) * placement.geometry.vector
    joints = um_per_m_k[MachinePart.BASE] * placement.joints
    moved = placement.by_parameters(changes[:, None]) + placement.by_joints(joints[..., None])
    warmer: Array = UM_PER_M * moved
    return warmer
