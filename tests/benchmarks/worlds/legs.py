"""Legs that stretch, joints that run out, and everything that is warmer than when it was drawn."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.closure import leg_forces
from tests.benchmarks.worlds.effects import Effect, Posture, Shift, Stops

TURN = 2.0 * np.pi
WARM_UP_HOURS = 0.5


@dataclass(frozen=True, eq=False)
class Elastic(Effect):
    """Legs stretch by (6,) mm a N under a weight (3,), N, at a centre (3,), mm, platform frame."""

    compliances: Array
    weight: Array
    centre: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        pull = leg_forces(posture.bodies, posture.poses, self.weight, self.centre)
        return Shift(lengths=self.compliances * pull)


@dataclass(frozen=True, eq=False)
class Play(Effect):
    """Legs are +-``half_mm`` longer or shorter as they are pulled or pushed, softly within ``soft_n``."""

    half_mm: float
    weight: Array
    centre: Array
    soft_n: float = 0.3

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        pull = leg_forces(posture.bodies, posture.poses, self.weight, self.centre)
        return Shift(lengths=self.half_mm * np.tanh(pull / self.soft_n))


@dataclass(frozen=True, eq=False)
class RunOut(Effect):
    """Joints' centres move as legs turn in them: ``size_mm``, one sigma along each axis.

    The displacement is a wave over the direction of the leg, with wave vectors and phases (6, 3).
    """

    size_mm: float
    waves: Array
    phases: Array
    at_platform: bool

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        toward, _ = posture.bodies.directions(posture.poses)
        if self.at_platform:
            toward = np.einsum("nji,nlj->nli", posture.poses.rotations, toward)
        angle = np.sum(toward * self.waves, axis=-1)[..., None] + self.phases
        moved = np.sqrt(2.0) * self.size_mm * np.sin(angle)
        return Shift(platform=moved) if self.at_platform else Shift(sliders=moved)


@dataclass(frozen=True, eq=False)
class AxesApart(Effect):
    """The two axes of platform joints pass each other at (6,) mm.

    The first is along x of the platform; the second, normal to it and to the leg, is off along the leg's
    part normal to the first.
    """

    distances: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        toward, _ = posture.bodies.directions(posture.poses)
        own = np.einsum("nji,nlj->nli", posture.poses.rotations, toward)
        own = own * np.array([0.0, 1.0, 1.0])
        own = own / np.linalg.norm(own, axis=-1, keepdims=True)
        return Shift(platform=self.distances[:, None] * own)


class Course(Enum):
    """How a temperature changes, as a share of its size by the hours of a campaign."""

    STEADY = "always the same"
    RISING = "by its size every hour"
    CENTRED = "by its size from the first record to the last, evenly, zero in the middle"
    WARMING_UP = "quickly at first, then hardly any more"

    def shares(self, hours: Array) -> Array:
        """Of its size, at some hours (n,)."""
        shares: Array
        match self:
            case Course.STEADY:
                shares = np.ones(len(hours))
            case Course.RISING:
                shares = hours
            case Course.CENTRED:
                shares = np.linspace(-0.5, 0.5, len(hours))
            case Course.WARMING_UP:
                shares = 1.0 - np.exp(-hours / WARM_UP_HOURS)
        return shares


@dataclass(frozen=True, eq=False)
class Warm(Effect):
    """Parts have grown by shares: legs (6,), the base across its rails and along them, the platform."""

    legs: Array
    base: float = 0.0
    platform: float = 0.0
    rails: float = 0.0
    course: Course = Course.STEADY

    def encoder_error(self, stops: Stops, shown: Array) -> Array:
        return -self.rails * self.course.shares(stops.hours)[:, None] * shown

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        share = self.course.shares(stops.hours)
        bodies = posture.bodies
        zero = bodies.sliders[..., 0] - posture.joints
        grown = np.stack(
            [self.rails * zero, self.base * bodies.sliders[..., 1], self.base * bodies.sliders[..., 2]],
            axis=-1,
        )
        return Shift(
            sliders=share[:, None, None] * grown,
            platform=self.platform * share[:, None, None] * bodies.platform,
            lengths=share[:, None] * self.legs * bodies.lengths,
        )


@dataclass(frozen=True, eq=False)
class Growing(Effect):
    """Legs grow (6,) mm an hour, or by as much at once at some hour."""

    growth: Array
    hour: float | None = None

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        share = stops.hours if self.hour is None else (stops.hours > self.hour).astype(float)
        return Shift(lengths=share[:, None] * self.growth)
