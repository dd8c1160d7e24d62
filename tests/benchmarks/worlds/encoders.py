"""Encoders that do not show where their sliders are."""

import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.effects import Effect, Stops, in_steps

TURN = 2.0 * np.pi


def scale(shares: Array) -> Effect:
    """Each encoder (6,) shows a share too much."""
    return Effect(encoder_error=lambda _, shown: shown * shares)


def curved(ends: Array, half_mm: float = 800.0) -> Effect:
    """Each encoder's scale changes along it: (6,) mm too much at the ends of +-``half_mm``."""
    return Effect(encoder_error=lambda _, shown: ends * (shown / half_mm) ** 2)


def periodic(amplitude_mm: float, period_mm: float, phases: Array) -> Effect:
    """Each encoder's interpolation is off by ``amplitude_mm`` once a period."""
    return Effect(encoder_error=lambda _, shown: amplitude_mm * np.sin(TURN * shown / period_mm + phases))


def offset(offsets: Array) -> Effect:
    """Each encoder's zero (6,) is off, mm."""
    return Effect(encoder_error=lambda _, shown: np.broadcast_to(offsets, shown.shape))


def hysteresis(half_mm: float | Array) -> Effect:
    """Encoders, or nuts, are off by +-``half_mm`` by the direction that a slider came from."""
    return Effect(encoder_error=lambda stops, _: half_mm * stops.directions, is_random=True)


def lost_counts(lost: Array, hour: float) -> Effect:
    """Encoders lose (6,) mm at some hour."""
    return Effect(encoder_error=lambda stops, _: (stops.hours > hour)[:, None] * lost)


def creep(speeds: Array) -> Effect:
    """Encoders' zeros creep, (6,) mm an hour."""
    return Effect(encoder_error=lambda stops, _: stops.hours[:, None] * speeds)


def resolution(step_mm: float) -> Effect:
    """Joint variables of records come in steps, whatever they are."""
    return Effect(encoder_noise=lambda stops: in_steps(stops.joints, step_mm) - stops.joints)


def more_noise(sigma_mm: float) -> Effect:
    """Noise of ``sigma_mm`` beside the stated one, in the record only."""
    return Effect(encoder_noise=lambda stops: sigma_mm * stops.random().standard_normal(stops.joints.shape))


def outliers(size_mm: float, share: float = 0.01) -> Effect:
    """A share of records has one joint variable off by +-``size_mm``."""

    def noise(stops: Stops) -> Array:
        random = stops.random()
        hit = random.random(len(stops)) < share
        leg = random.integers(0, 6, len(stops))
        sign = random.choice([-1.0, 1.0], len(stops))
        error: Array = (hit * sign * size_mm)[:, None] * (np.arange(6) == leg[:, None])
        return error

    return Effect(encoder_noise=noise)
