"""Rails that are not straight, not parallel, twisted; sliders that stop elsewhere each time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.closure import leg_forces
from tests.benchmarks.worlds.effects import Effect, Posture, Shift, Stops

TURN = 2.0 * np.pi
RAILS = np.array([0, 1, 2, 2, 1, 0])
"""Which rail each slider of the drawing runs on: there are two on each of three."""

HALF_MM = 800.0
"""Half the length of a rail."""


def along_rails(posture: Posture) -> Array:
    """Where the slider joints are along their rails (n, 6), mm."""
    places: Array = posture.bodies.sliders[..., 0]
    return places


@dataclass(frozen=True, eq=False)
class Wavy(Effect):
    """Each slider's way is a wave along some directions (3,), ``amplitude_mm`` high.

    ``phases`` (6, 3) are those of the ways of sliders.
    """

    amplitude_mm: float
    wave_mm: float
    directions: Array
    phases: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        angle = TURN * along_rails(posture)[..., None] / self.wave_mm + self.phases
        return Shift(sliders=self.amplitude_mm * self.directions * np.sin(angle))


@dataclass(frozen=True, eq=False)
class Sagging(Effect):
    """Rails hang down in the middle, (6,) mm there and nothing at both ends."""

    depths: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        down = -self.depths * (1.0 - (along_rails(posture) / HALF_MM) ** 2)
        return Shift(sliders=down[..., None] * np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True, eq=False)
class NotParallel(Effect):
    """Rails lead aside (6,) and up (6,), rad, about their middle."""

    yaw: Array
    pitch: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        tangent = np.stack([np.zeros(6), self.yaw, self.pitch], axis=-1)
        return Shift(sliders=along_rails(posture)[..., None] * tangent)


@dataclass(frozen=True, eq=False)
class Twisted(Effect):
    """Rails roll (6,) rad from the middle to an end, which moves joints on an arm (3,), mm."""

    rolls: Array
    arm: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        roll = self.rolls * along_rails(posture) / HALF_MM
        sideways = np.cross([1.0, 0.0, 0.0], self.arm)
        return Shift(sliders=roll[..., None] * sideways)


@dataclass(frozen=True, eq=False)
class Nodding(Effect):
    """Sliders pitch by a wave of ``amplitude`` rad, which moves joints ``arm_mm`` high along the rail."""

    amplitude: float
    wave_mm: float
    arm_mm: float
    phases: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        pitch = self.amplitude * np.sin(TURN * along_rails(posture) / self.wave_mm + self.phases)
        return Shift(sliders=self.arm_mm * pitch[..., None] * np.array([1.0, 0.0, 0.0]))


@dataclass(frozen=True, eq=False)
class Bump(Effect):
    """Each way has a bump of a height, a width (standard deviation) and a place (6,), mm."""

    height_mm: float
    width_mm: float
    places: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        away = (along_rails(posture) - self.places) / self.width_mm
        up = self.height_mm * np.exp(-0.5 * away**2)
        return Shift(sliders=up[..., None] * np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True, eq=False)
class Stopping(Effect):
    """At every stop sliders are elsewhere along some directions (3,), one sigma; encoders do not see it."""

    sigma_mm: float
    directions: Array
    is_random = True

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        drawn = stops.random().standard_normal((len(stops), 6, 3))
        return Shift(sliders=self.sigma_mm * self.directions * drawn)


@dataclass(frozen=True, eq=False)
class Following(Effect):
    """At every stop sliders are elsewhere, one sigma, as the encoders show."""

    sigma_mm: float
    is_random = True

    def following_error(self, stops: Stops) -> Array:
        return self.sigma_mm * stops.random().standard_normal((len(stops), 6))


@dataclass(frozen=True, eq=False)
class Yielding(Effect):
    """Slider joints yield along z by (6,) mm for each N that their leg pulls."""

    compliances: Array
    weight: Array
    centre: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        toward, _ = posture.bodies.directions(posture.poses)
        pull = leg_forces(posture.bodies, posture.poses, self.weight, self.centre)
        down = -self.compliances * pull * toward[..., 2]
        return Shift(sliders=down[..., None] * np.array([0.0, 0.0, 1.0]))
