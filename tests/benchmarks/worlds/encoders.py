"""Encoders that do not show where their sliders are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.effects import Effect, Stops, in_steps

TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Scale(Effect):
    """Each encoder (6,) shows a share too much."""

    shares: Array

    def encoder_error(self, stops: Stops, shown: Array) -> Array:
        return shown * self.shares


@dataclass(frozen=True, eq=False)
class Curved(Effect):
    """Each encoder's scale changes along it: (6,) mm too much at the ends of +-``half_mm``."""

    ends: Array
    half_mm: float = 800.0

    def encoder_error(self, stops: Stops, shown: Array) -> Array:
        return self.ends * (shown / self.half_mm) ** 2


@dataclass(frozen=True, eq=False)
class Periodic(Effect):
    """Each encoder's interpolation is off by ``amplitude_mm`` once a period."""

    amplitude_mm: float
    period_mm: float
    phases: Array

    def encoder_error(self, stops: Stops, shown: Array) -> Array:
        return self.amplitude_mm * np.sin(TURN * shown / self.period_mm + self.phases)


@dataclass(frozen=True, eq=False)
class Offset(Effect):
    """Each encoder's zero (6,) is off, mm."""

    offsets: Array

    def encoder_error(self, stops: Stops, shown: Array) -> Array:
        return np.broadcast_to(self.offsets, shown.shape)


@dataclass(frozen=True, eq=False)
class Hysteresis(Effect):
    """Encoders, or nuts, are off by +-``half_mm`` by the direction that a slider came from."""

    half_mm: float
    is_random = True

    def encoder_error(self, stops: Stops, shown: Array) -> Array:
        return self.half_mm * stops.directions


@dataclass(frozen=True, eq=False)
class LostCounts(Effect):
    """Encoders lose (6,) mm at some hour."""

    lost: Array
    hour: float

    def encoder_error(self, stops: Stops, shown: Array) -> Array:
        return (stops.hours > self.hour)[:, None] * self.lost


@dataclass(frozen=True, eq=False)
class Creep(Effect):
    """Encoders' zeros creep, (6,) mm an hour."""

    speeds: Array

    def encoder_error(self, stops: Stops, shown: Array) -> Array:
        return stops.hours[:, None] * self.speeds


@dataclass(frozen=True, eq=False)
class Resolution(Effect):
    """Joint variables of records come in steps, whatever they are."""

    step_mm: float

    def encoder_noise(self, stops: Stops) -> Array:
        return in_steps(stops.joints, self.step_mm) - stops.joints


@dataclass(frozen=True, eq=False)
class MoreNoise(Effect):
    """Noise of ``sigma_mm`` beside the stated one, in the record only."""

    sigma_mm: float

    def encoder_noise(self, stops: Stops) -> Array:
        return self.sigma_mm * stops.random().standard_normal(stops.joints.shape)


@dataclass(frozen=True, eq=False)
class Outliers(Effect):
    """A share of records has one joint variable off by +-``size_mm``."""

    size_mm: float
    share: float = 0.01

    def encoder_noise(self, stops: Stops) -> Array:
        random = stops.random()
        hit = random.random(len(stops)) < self.share
        leg = random.integers(0, 6, len(stops))
        sign = random.choice([-1.0, 1.0], len(stops))
        error: Array = (hit * sign * self.size_mm)[:, None] * (np.arange(6) == leg[:, None])
        return error
