"""Gauges, stands and balls that do not show how far the ball has moved."""

import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.effects import Effect, Shift, Stops

TURN = 2.0 * np.pi


def linear(matrices: Array) -> Effect:
    """Gauges read a linear function of the displacement too much: one matrix (3, 3) for each point.

    That is scale, a turned triad, and plungers that are not square to each other or to their plates.
    """
    return Effect(
        gauge_error=lambda stops, moved: np.einsum(
            "nij,nj->ni", matrices[stops.points % len(matrices)], moved
        )
    )


def bent(ends: Array, half_mm: float = 5.0) -> Effect:
    """Gauges (3,) are off by so many mm at both ends of a travel of +-``half_mm``."""
    return Effect(gauge_error=lambda _, moved: ends * (moved / half_mm) ** 2)


def periodic(amplitude_mm: float, period_mm: float, phases: Array) -> Effect:
    """Gauges' pinions are off by ``amplitude_mm`` once a period."""
    return Effect(gauge_error=lambda _, moved: amplitude_mm * np.sin(TURN * moved / period_mm + phases))


def hysteresis(half_mm: float) -> Effect:
    """Gauges stick by ``half_mm`` by the direction that the ball came from."""
    return Effect(
        gauge_error=lambda _, moved: -half_mm * np.sign(np.diff(moved, axis=0, prepend=moved[:1]))
    )


def more_noise(sigma_mm: Array, freedom: float | None = None) -> Effect:
    """Noise of gauges (3,) beside the stated one; of Student's distribution with some freedom."""

    def error(stops: Stops, moved: Array) -> Array:
        random = stops.random()
        if freedom is None:
            return sigma_mm * random.standard_normal(moved.shape)
        scale = np.sqrt((freedom - 2.0) / freedom)
        noise: Array = sigma_mm * scale * random.standard_t(freedom, moved.shape)
        return noise

    return Effect(gauge_error=error)


def outliers(size_mm: float, share: float = 0.01) -> Effect:
    """A share of readings is off by +-``size_mm``."""

    def error(stops: Stops, moved: Array) -> Array:
        random = stops.random()
        hit = random.random(moved.shape) < share
        found: Array = hit * random.choice([-size_mm, size_mm], moved.shape)
        return found

    return Effect(gauge_error=error)


def drifting(speeds: Array) -> Effect:
    """Stands drift (points, 3) mm an hour from when they were placed."""
    return Effect(
        gauge_error=lambda stops, _: _since_placed(stops)[:, None] * speeds[stops.points % len(speeds)]
    )


def turning(speeds: Array, arm: Array) -> Effect:
    """Stands turn (3,) rad an hour, about the place where they were zeroed, and ``arm`` (3,), mm, off."""
    return Effect(
        gauge_error=lambda stops, moved: -np.cross(_since_placed(stops)[:, None] * speeds, moved + arm)
    )


def jump(offset: Array, hour: float) -> Effect:
    """A stand is pushed (3,) mm at some hour and stays there until it is placed anew."""

    def error(stops: Stops, _: Array) -> Array:
        at = stops.points[np.searchsorted(stops.hours, hour).clip(0, len(stops) - 1)]
        pushed = (stops.hours > hour) & (stops.points == at)
        found: Array = pushed[:, None] * offset
        return found

    return Effect(gauge_error=error)


def out_of_round(size_mm: float, axis: Array, order: int) -> Effect:
    """The ball's radius varies with the direction on it, ``size_mm`` at most: zonal, of order 2 or 3.

    A flat anvil along an axis touches it where its normal is, to first order in the size.
    """

    def ball(_: Stops, rotations: Array) -> Array:
        # Row k of R is base axis k in the platform frame: there, on the ball's side, the anvil touches.
        cosine = rotations @ axis
        shape: Array = {2: 1.5 * cosine**2 - 0.5, 3: 2.5 * cosine**3 - 1.5 * cosine}[order]
        return size_mm * shape

    return Effect(ball=ball)


def oval(form: Array) -> Effect:
    """The ball's radius is a quadratic form, trace zero, of the direction on it: matrix (3, 3), mm."""
    return Effect(ball=lambda _, rotations: np.einsum("nki,ij,nkj->nk", rotations, form, rotations))


def ball_moves(offset: Array, hour: float | None = None) -> Effect:
    """The ball moves on the platform: (3,) mm an hour, or by as much at once at some hour."""
    return Effect(ball=lambda stops, rotations: stops.shares(hour)[:, None] * (rotations @ offset))


def ball_elsewhere(offset: Array) -> Effect:
    """The ball is (3,) mm, platform frame, from where it is thought to be; the tool is where it should."""
    return Effect(ball=lambda _, rotations: rotations @ offset)


def tool_elsewhere(offset: Array) -> Effect:
    """The ball is where the tool is, (3,) mm from where the drawing has it."""
    return Effect(shift=lambda *_: Shift(platform=-offset))


def stem_bends(share: float) -> Effect:
    """Plungers push the ball aside: by a share of how far they are pressed in."""
    return Effect(gauge_error=lambda _, moved: -share * moved)


def _since_placed(stops: Stops) -> Array:
    """Hours (n,) since the gauges were placed at the point of each stop."""
    first = {point: stops.hours[row] for row, point in reversed(list(enumerate(stops.points.tolist())))}
    since: Array = stops.hours - np.array([first[point] for point in stops.points.tolist()])
    return since
