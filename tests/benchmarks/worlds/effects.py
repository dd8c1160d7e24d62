"""What an effect of an imperfect machine may change: nothing, unless a subclass says so."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from tests.benchmarks.worlds.closure import Bodies

RECORD_HOURS = 0.5 / 60.0
MOVE_GAUGES_HOURS = 10.0 / 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Stops:
    """n stops of a machine, in their order.

    Attributes:
        points: number of the gauges' place at each stop (n,), counted from 0.
        hours: when they are, since the machine was switched to work (n,).
        joints: what the controller drives the encoders to (n, 6), mm.
        before: the same at the stop before (n, 6), mm.
        seed: of what is random at these stops.
        at_work: whether the robot is at work, and nothing is measured.
    """

    points: NDArray[np.intp]
    hours: Array
    joints: Array
    before: Array
    seed: tuple[int, ...] = ()
    at_work: bool = False

    @classmethod
    def of(cls, points: NDArray[np.intp], joints: Array, start: float, seed: tuple[int, ...]) -> Stops:
        """Stops one after the other from ``start``, hours, with time to move the gauges between points."""
        moved = np.diff(points, prepend=points[:1]) != 0
        hours = start + np.cumsum(RECORD_HOURS + MOVE_GAUGES_HOURS * moved)
        return cls(points, hours, joints, np.roll(joints, 1, axis=0), seed)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def directions(self) -> Array:
        """Whether each slider came from below, 1, or from above, -1 (n, 6)."""
        return np.where(self.joints < self.before, -1.0, 1.0)

    def of_effect(self, number: int) -> Stops:
        """The same with a random sequence of its own."""
        return replace(self, seed=(*self.seed, number))

    def random(self) -> np.random.Generator:
        """The same sequence whenever it is asked for."""
        return np.random.default_rng(self.seed)


@dataclass(frozen=True, slots=True, eq=False)
class Posture:
    """The machine as it stands at n stops.

    Attributes:
        joints: where the sliders really are along their rails (n, 6), mm.
        bodies: what the legs join.
        poses: of the platform.
    """

    joints: Array
    bodies: Bodies
    poses: PoseBatch


@dataclass(frozen=True, slots=True)
class Shift:
    """How joints and lengths differ from the geometry: (n, 6, 3), (n, 6, 3) and (n, 6), mm, or zero."""

    sliders: Array | float = 0.0
    platform: Array | float = 0.0
    lengths: Array | float = 0.0

    def __add__(self, other: Shift) -> Shift:
        return Shift(
            self.sliders + other.sliders, self.platform + other.platform, self.lengths + other.lengths
        )


class Effect:
    """One imperfection. Every hook gives a difference to the perfect machine, which is zero here."""

    is_random = False
    """Whether the platform is elsewhere at every visit of a pose."""

    def encoder_error(self, stops: Stops, shown: Array) -> Array | float:
        """What encoders show too much (n, 6), mm, where they show ``shown``; the servos do not see it."""
        return 0.0

    def following_error(self, stops: Stops) -> Array | float:
        """How far sliders stop from where they should (n, 6), mm; the encoders show it."""
        return 0.0

    def encoder_noise(self, stops: Stops) -> Array | float:
        """What is added to the joint variables of a record only (n, 6), mm."""
        return 0.0

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        """What joints and lengths are off."""
        return Shift()

    def ball(self, stops: Stops, rotations: Array) -> Array | float:
        """Where the ball's surface is that the gauges touch, off its reference (n, 3), mm, base frame."""
        return 0.0

    def gauge_error(self, stops: Stops, moved: Array) -> Array | float:
        """What gauges read too much (n, 3), mm, where the ball has moved by ``moved`` since their zero."""
        return 0.0


@dataclass(frozen=True, eq=False)
class Several(Effect):
    """Effects together."""

    effects: tuple[Effect, ...] = field(default=())

    @property
    def is_random(self) -> bool:  # type: ignore[override]
        return any(effect.is_random for effect in self.effects)

    def _each(self, stops: Stops) -> list[tuple[Effect, Stops]]:
        return [(effect, stops.of_effect(number)) for number, effect in enumerate(self.effects)]

    def encoder_error(self, stops: Stops, shown: Array) -> Array | float:
        return sum((one.encoder_error(own, shown) for one, own in self._each(stops)), start=0.0)

    def following_error(self, stops: Stops) -> Array | float:
        return sum((one.following_error(own) for one, own in self._each(stops)), start=0.0)

    def encoder_noise(self, stops: Stops) -> Array | float:
        return sum((one.encoder_noise(own) for one, own in self._each(stops)), start=0.0)

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        return sum((one.shift(own, posture) for one, own in self._each(stops)), start=Shift())

    def ball(self, stops: Stops, rotations: Array) -> Array | float:
        return sum((one.ball(own, rotations) for one, own in self._each(stops)), start=0.0)

    def gauge_error(self, stops: Stops, moved: Array) -> Array | float:
        return sum((one.gauge_error(own, moved) for one, own in self._each(stops)), start=0.0)


@dataclass(frozen=True, eq=False)
class Only(Effect):
    """An effect that is there at work only, or while measuring only."""

    effect: Effect
    at_work: bool

    @property
    def is_random(self) -> bool:  # type: ignore[override]
        return self.effect.is_random

    def encoder_error(self, stops: Stops, shown: Array) -> Array | float:
        return self._acting(stops).encoder_error(stops, shown)

    def following_error(self, stops: Stops) -> Array | float:
        return self._acting(stops).following_error(stops)

    def encoder_noise(self, stops: Stops) -> Array | float:
        return self._acting(stops).encoder_noise(stops)

    def shift(self, stops: Stops, posture: Posture) -> Shift:
        return self._acting(stops).shift(stops, posture)

    def ball(self, stops: Stops, rotations: Array) -> Array | float:
        return self._acting(stops).ball(stops, rotations)

    def gauge_error(self, stops: Stops, moved: Array) -> Array | float:
        return self._acting(stops).gauge_error(stops, moved)

    def _acting(self, stops: Stops) -> Effect:
        return self.effect if stops.at_work == self.at_work else Effect()


def in_steps(values: Array, step: float) -> Array:
    """Values rounded to multiples of a step, if there is one."""
    return step * np.round(values / step) if step else values
