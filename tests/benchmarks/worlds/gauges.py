"""Gauges, stands and balls that do not show how far the ball has moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.effects import Effect, Posture, Shift, Stops, in_steps

TURN = 2.0 * np.pi
WARM_UP_HOURS = 0.2


@dataclass(frozen=True, eq=False)
class Linear(Effect):
    """Gauges read a linear function of the displacement too much: one matrix (3, 3) for each point.

    That is scale, a turned triad, and plungers that are not square to each other or to their plates.
    """

    matrices: Array

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        error: Array = np.einsum("nij,nj->ni", self.matrices[stops.points % len(self.matrices)], moved)
        return error


@dataclass(frozen=True, eq=False)
class Bent(Effect):
    """Gauges (3,) are off by so many mm at both ends of a travel of +-``half_mm``."""

    ends: Array
    half_mm: float = 5.0

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        return self.ends * (moved / self.half_mm) ** 2


@dataclass(frozen=True, eq=False)
class Periodic(Effect):
    """Gauges' pinions are off by ``amplitude_mm`` once a period."""

    amplitude_mm: float
    period_mm: float
    phases: Array

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        return self.amplitude_mm * np.sin(TURN * moved / self.period_mm + self.phases)


@dataclass(frozen=True, eq=False)
class Hysteresis(Effect):
    """Gauges stick by ``half_mm`` by the direction that the ball came from."""

    half_mm: float

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        return -self.half_mm * np.sign(np.diff(moved, axis=0, prepend=moved[:1]))


@dataclass(frozen=True, eq=False)
class Resolution(Effect):
    """Gauges read in steps."""

    step_mm: float

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        return in_steps(moved, self.step_mm) - moved


@dataclass(frozen=True, eq=False)
class MoreNoise(Effect):
    """Noise of gauges (3,) beside the stated one; of Student's distribution with some freedom."""

    sigma_mm: Array
    freedom: float | None = None

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        random = stops.random()
        if self.freedom is None:
            return self.sigma_mm * random.standard_normal(moved.shape)
        scale = np.sqrt((self.freedom - 2.0) / self.freedom)
        noise: Array = self.sigma_mm * scale * random.standard_t(self.freedom, moved.shape)
        return noise


@dataclass(frozen=True, eq=False)
class Outliers(Effect):
    """A share of readings is off by +-``size_mm``."""

    size_mm: float
    share: float = 0.01

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        random = stops.random()
        hit = random.random(moved.shape) < self.share
        error: Array = hit * random.choice([-self.size_mm, self.size_mm], moved.shape)
        return error


@dataclass(frozen=True, eq=False)
class Drifting(Effect):
    """Stands drift (points, 3) mm an hour from when they were placed; quickly at first if warming up."""

    speeds: Array
    warming_up: bool = False

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        hours = _since_placed(stops)
        if self.warming_up:
            hours = WARM_UP_HOURS * (1.0 - np.exp(-hours / WARM_UP_HOURS))
        return hours[:, None] * self.speeds[stops.points % len(self.speeds)]


@dataclass(frozen=True, eq=False)
class Turning(Effect):
    """Stands turn (3,) rad an hour, about the place where they were zeroed, and ``arm`` (3,), mm, off."""

    speeds: Array
    arm: Array

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        turned = _since_placed(stops)[:, None] * self.speeds
        return -np.cross(turned, moved + self.arm)


@dataclass(frozen=True, eq=False)
class Jump(Effect):
    """A stand is pushed (3,) mm at some hour and stays there until it is placed anew."""

    offset: Array
    hour: float

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        at = stops.points[np.searchsorted(stops.hours, self.hour).clip(0, len(stops) - 1)]
        pushed = (stops.hours > self.hour) & (stops.points == at)
        error: Array = pushed[:, None] * self.offset
        return error


@dataclass(frozen=True, eq=False)
class OutOfRound(Effect):
    """The ball's radius varies with the direction on it, ``size_mm`` at most: zonal, of order 2 or 3.

    A flat anvil along an axis touches it where its normal is, to first order in the size.
    """

    size_mm: float
    axis: Array
    order: int

    def ball(self, stops: Stops, rotations: Array) -> Array:
        # Row k of R is base axis k in the platform frame: there, on the ball's side, the anvil touches.
        cosine = rotations @ self.axis
        shape = {2: 1.5 * cosine**2 - 0.5, 3: 2.5 * cosine**3 - 1.5 * cosine}[self.order]
        return self.size_mm * shape


@dataclass(frozen=True, eq=False)
class Oval(Effect):
    """The ball's radius is a quadratic form, trace zero, of the direction on it: matrix (3, 3), mm."""

    form: Array

    def ball(self, stops: Stops, rotations: Array) -> Array:
        off: Array = np.einsum("nki,ij,nkj->nk", rotations, self.form, rotations)
        return off


@dataclass(frozen=True, eq=False)
class BallMoves(Effect):
    """The ball moves on the platform: (3,) mm an hour, or by as much at once at some hour."""

    offset: Array
    hour: float | None = None

    def ball(self, stops: Stops, rotations: Array) -> Array:
        share = stops.hours if self.hour is None else (stops.hours > self.hour).astype(float)
        return share[:, None] * (rotations @ self.offset)


@dataclass(frozen=True, eq=False)
class BallElsewhere(Effect):
    """The ball is (3,) mm, platform frame, from where it is thought to be; the tool is where it should."""

    offset: Array

    def ball(self, stops: Stops, rotations: Array) -> Array:
        return rotations @ self.offset


@dataclass(frozen=True, eq=False)
class ToolElsewhere(Effect):
    """The ball is where the tool is, (3,) mm from where the drawing has it."""

    offset: Array

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        return Shift(platform=-self.offset)


@dataclass(frozen=True, eq=False)
class StemBends(Effect):
    """Plungers push the ball aside: by a share of how far they are pressed in."""

    share: float

    def gauge_error(self, stops: Stops, moved: Array) -> Array:
        return -self.share * moved


def _since_placed(stops: Stops) -> Array:
    """Hours (n,) since the gauges were placed at the point of each stop."""
    first = {point: stops.hours[row] for row, point in reversed(list(enumerate(stops.points.tolist())))}
    since: Array = stops.hours - np.array([first[point] for point in stops.points.tolist()])
    return since
