"""Legs that stretch, joints that run out, and everything that is warmer than when it was drawn."""

from collections.abc import Callable
from dataclasses import replace
from enum import Enum

import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.closure import leg_forces
from tests.benchmarks.worlds.effects import Effect, Posture, Shift, Stops


def _longer(of_pull: Callable[[Array], Array], weight: Array, centre: Array) -> Effect:
    """Legs are longer by a function of their pull (n, 6), N, under a weight (3,) at a centre (3,)."""
    return Effect(
        shift=lambda _, posture: Shift(
            lengths=of_pull(leg_forces(posture.bodies, posture.poses, weight, centre))
        )
    )


def elastic(compliances: Array, weight: Array, centre: Array) -> Effect:
    """Legs stretch by (6,) mm a N under a weight (3,), N, at a centre (3,), mm, platform frame."""
    return _longer(lambda pull: compliances * pull, weight, centre)


def play(half_mm: float | Array, weight: Array, centre: Array, soft_n: float = 0.3) -> Effect:
    """Legs are +-``half_mm`` longer or shorter as they are pulled or pushed, softly within ``soft_n``.

    One that may lie on either side stays on that on which it is.
    """
    one_side = _longer(lambda pull: half_mm * np.tanh(pull / soft_n), weight, centre)
    return replace(one_side, has_memory=bool(np.any(half_mm)))


def run_out(size_mm: float, waves: Array, phases: Array) -> Effect:
    """Centres of platform joints move as legs turn in them: ``size_mm``, one sigma along each axis.

    The displacement is a wave over the direction of the leg, with wave vectors and phases (6, 3).
    """

    def shift(_: Stops, posture: Posture) -> Shift:
        angle = np.sum(_on_platform(posture) * waves, axis=-1)[..., None] + phases
        return Shift(platform=np.sqrt(2.0) * size_mm * np.sin(angle))

    return Effect(shift=shift)


def axes_apart(distances: Array) -> Effect:
    """The two axes of platform joints pass each other at (6,) mm.

    The first is along x of the platform; the second, normal to it and to the leg, is off along the leg's
    part normal to the first.
    """

    def shift(_: Stops, posture: Posture) -> Shift:
        own = _on_platform(posture) * np.array([0.0, 1.0, 1.0])
        own = own / np.linalg.norm(own, axis=-1, keepdims=True)
        return Shift(platform=distances[:, None] * own)

    return Effect(shift=shift)


def _on_platform(posture: Posture) -> Array:
    """Directions of the legs (n, 6, 3) in the platform frame."""
    toward, _ = posture.bodies.directions(posture.poses)
    own: Array = np.einsum("nji,nlj->nli", posture.poses.rotations, toward)
    return own


class Course(Enum):
    """How a temperature changes, as a share of its size by the hours of a campaign."""

    STEADY = "always the same"
    RISING = "by its size every hour"
    CENTRED = "by its size from the first record to the last, evenly, zero in the middle"

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
        return shares


def warm(
    legs: Array,
    base: float = 0.0,
    platform: float = 0.0,
    rails: float = 0.0,
    course: Course = Course.STEADY,
) -> Effect:
    """Parts have grown by shares: legs (6,), the base across its rails and along them, the platform."""

    def encoder_error(stops: Stops, shown: Array) -> Array:
        return -rails * course.shares(stops.hours)[:, None] * shown

    def shift(stops: Stops, posture: Posture) -> Shift:
        share, bodies = course.shares(stops.hours), posture.bodies
        zero = bodies.sliders[..., 0] - posture.joints
        grown = np.stack(
            [rails * zero, base * bodies.sliders[..., 1], base * bodies.sliders[..., 2]], axis=-1
        )
        return Shift(
            sliders=share[:, None, None] * grown,
            platform=platform * share[:, None, None] * bodies.platform,
            lengths=share[:, None] * legs * bodies.lengths,
        )

    return Effect(encoder_error=encoder_error, shift=shift)


def growing(growth: Array, hour: float | None = None) -> Effect:
    """Legs grow (6,) mm an hour, or by as much at once at some hour."""
    return Effect(shift=lambda stops, _: Shift(lengths=stops.shares(hour)[:, None] * growth))
