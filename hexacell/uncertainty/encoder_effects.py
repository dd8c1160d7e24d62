"""Effects of the encoders: errors of their scales, and stops that they do not see."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.parameters import LEGS, JointUnit
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import Effect, Occurrence, Placement

COMMON_SCALE = "scale common to all encoders"
"""The effect that a length check measures."""

THOUSANDTH = 1e-3
"""A micrometre in mm, a millidegree in deg."""


def common_encoder_scale(um_per_m: float, source: str = "") -> Effect:
    """All encoders are wrong by the same share, as of a common temperature or calibration.

    Nothing that the gauges measure tells it from a machine that is larger by the same share.
    """
    return Effect(COMMON_SCALE, um_per_m, "um/m", Occurrence.CONSTANT, _common_scale, source=source)


def encoder_scales(um_per_m: float, source: str = "") -> Effect:
    """Each encoder is wrong by a share of its own."""
    return Effect(
        "scale of each encoder", um_per_m, "um/m", Occurrence.CONSTANT, _each_scale, source=source
    )


def encoder_eccentricities(mdeg: float, source: str = "") -> Effect:
    """The disc of each rotary encoder is off its axis in any direction: its error is a sine over a turn."""
    name = "eccentricity of each encoder"
    return Effect(name, mdeg, "mdeg", Occurrence.CONSTANT, _each_eccentricity, source=source)


def stop_repeatability(
    size: float,
    source: str = "",
    *,
    is_in_noise: bool = False,
    joint: str = "joint",
    unit: JointUnit = JointUnit.MM,
) -> Effect:
    """A joint stops beside what its encoder shows, each time elsewhere: play, friction.

    ``size`` is in um or mdeg. ``is_in_noise``: the noise of the records contains it. ``joint`` is the
    mechanism's word for it.
    """
    occurrence = Occurrence.STOPS_AT_WORK if is_in_noise else Occurrence.EVERY_STOP
    name = f"repeatability of a {joint}"
    return Effect(name, size, unit.thousandth, occurrence, _each_joint, source=source)


def _common_scale(placement: Placement) -> Array:
    return placement.by_joints(1e-6 * placement.joints[..., None])


def _each_scale(placement: Placement) -> Array:
    return placement.by_joints(1e-6 * placement.joints[..., None] * np.eye(LEGS))


def _each_eccentricity(placement: Placement) -> Array:
    """Two causes a joint; a wave whose phase is unknown has half the variance in each."""
    angles = np.radians(placement.joints)[..., None]
    waves = np.sqrt(0.5) * np.concatenate(
        [np.cos(angles) * np.eye(LEGS), np.sin(angles) * np.eye(LEGS)], axis=-1
    )
    return placement.by_joints(THOUSANDTH * waves)


def _each_joint(placement: Placement) -> Array:
    return placement.by_joints(np.broadcast_to(THOUSANDTH * np.eye(LEGS), (len(placement), LEGS, LEGS)))
