"""Rails that are not straight, not parallel, twisted; sliders that stop elsewhere each time."""

import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.closure import leg_forces
from tests.benchmarks.worlds.effects import Effect, Posture, Shift, Stops

TURN = 2.0 * np.pi
RAILS = np.array([0, 1, 2, 2, 1, 0])
"""Which rail each slider of the drawing runs on: there are two on each of three."""

HALF_MM = 800.0
"""Half the length of a rail."""

X, _, Z = np.eye(3)


def along_rails(posture: Posture) -> Array:
    """Where the slider joints are along their rails (n, 6), mm."""
    places: Array = posture.bodies.sliders[..., 0]
    return places


def _aside(amounts: Array, direction: Array) -> Shift:
    """Slider joints moved by (n, 6) along a direction, or (n, 6, 1) each along its own."""
    return Shift(sliders=amounts[..., None] * direction)


def wavy(amplitude_mm: float, wave_mm: float, directions: Array, phases: Array) -> Effect:
    """Each slider's way is a wave along some directions (3,), ``amplitude_mm`` high.

    ``phases`` (6, 3) are those of the ways of sliders.
    """

    def shift(_: Stops, posture: Posture) -> Shift:
        angle = TURN * along_rails(posture)[..., None] / wave_mm + phases
        return Shift(sliders=amplitude_mm * directions * np.sin(angle))

    return Effect(shift=shift)


def sagging(depths: Array) -> Effect:
    """Rails hang down in the middle, (6,) mm there and nothing at both ends."""
    return Effect(
        shift=lambda _, posture: _aside(-depths * (1.0 - (along_rails(posture) / HALF_MM) ** 2), Z)
    )


def not_parallel(yaw: Array, pitch: Array) -> Effect:
    """Rails lead aside (6,) and up (6,), rad, about their middle."""
    tangent = np.stack([np.zeros(6), yaw, pitch], axis=-1)
    return Effect(shift=lambda _, posture: _aside(along_rails(posture), tangent))


def twisted(rolls: Array, arm: Array) -> Effect:
    """Rails roll (6,) rad from the middle to an end, which moves joints on an arm (3,), mm."""
    return Effect(shift=lambda _, posture: _aside(rolls * along_rails(posture) / HALF_MM, np.cross(X, arm)))


def nodding(amplitude: float, wave_mm: float, arm_mm: float, phases: Array) -> Effect:
    """Sliders pitch by a wave of ``amplitude`` rad, which moves joints ``arm_mm`` high along the rail."""
    return Effect(
        shift=lambda _, posture: _aside(
            arm_mm * amplitude * np.sin(TURN * along_rails(posture) / wave_mm + phases), X
        )
    )


def bump(height_mm: float, width_mm: float, places: Array) -> Effect:
    """Each way has a bump of a height, a width (standard deviation) and a place (6,), mm."""

    def shift(_: Stops, posture: Posture) -> Shift:
        away = (along_rails(posture) - places) / width_mm
        return _aside(height_mm * np.exp(-0.5 * away**2), Z)

    return Effect(shift=shift)


def stopping(sigma_mm: float, directions: Array) -> Effect:
    """At every stop sliders are elsewhere along some directions (3,), one sigma; encoders do not see it."""

    def shift(stops: Stops, _: Posture) -> Shift:
        drawn = stops.random().standard_normal((len(stops), 6, 3))
        return Shift(sliders=sigma_mm * directions * drawn)

    return Effect(shift=shift, is_random=True)


def following(sigma_mm: float) -> Effect:
    """At every stop sliders are elsewhere, one sigma, as the encoders show."""
    return Effect(
        following_error=lambda stops: sigma_mm * stops.random().standard_normal((len(stops), 6)),
        is_random=True,
    )


def yielding(compliances: Array, weight: Array, centre: Array) -> Effect:
    """Slider joints yield along z by (6,) mm for each N that their leg pulls."""

    def shift(_: Stops, posture: Posture) -> Shift:
        toward, _distances = posture.bodies.directions(posture.poses)
        pull = leg_forces(posture.bodies, posture.poses, weight, centre)
        return _aside(-compliances * pull * toward[..., 2], Z)

    return Effect(shift=shift)
