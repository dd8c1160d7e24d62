"""What an effect of an imperfect machine may change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

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
        previous: which of these stops the machine comes from (n,).
        seed: of what is random at these stops.
        at_work: whether the robot is at work, and nothing is measured.
        sides: from which sides sliders come over a waypoint (n, 6), 1 or -1; 0 for straight. None: all do.
    """

    points: NDArray[np.intp]
    hours: Array
    joints: Array
    previous: NDArray[np.intp]
    seed: tuple[int, ...] = ()
    at_work: bool = False
    sides: Array | None = None

    @classmethod
    def of(cls, points: NDArray[np.intp], joints: Array, start: float, seed: tuple[int, ...]) -> Stops:
        """Stops one after the other from ``start``, hours, with time to move the gauges between points."""
        moved = np.diff(points, prepend=points[:1]) != 0
        hours = start + np.cumsum(RECORD_HOURS + MOVE_GAUGES_HOURS * moved)
        return cls(points, hours, joints, np.roll(np.arange(len(points)), 1), seed)

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: NDArray[np.intp]) -> Stops:
        """Some of them, as if each came from itself: what is left to ask of them has been computed."""
        parts = self.points[rows], self.hours[rows], self.joints[rows], np.arange(len(rows))
        return Stops(*parts, self.seed, self.at_work, None if self.sides is None else self.sides[rows])

    @property
    def directions(self) -> Array:
        """Whether each slider came from below, 1, or from above, -1 (n, 6)."""
        straight = np.where(self.joints < self.joints[self.previous], -1.0, 1.0)
        return straight if self.sides is None else np.where(self.sides == 0.0, straight, self.sides)

    def of_effect(self, number: int) -> Stops:
        """The same with a random sequence of its own."""
        return replace(self, seed=(*self.seed, number))

    def shares(self, hour: float | None) -> Array:
        """The hours (n,), or if one is named, whether it is over."""
        return self.hours if hour is None else (self.hours > hour).astype(float)

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


NOTHING: Array = np.zeros(())


def _nothing(*_: object) -> Array:
    return NOTHING


def _no_shift(*_: object) -> Shift:
    return Shift()


@dataclass(frozen=True, eq=False)
class Effect:
    """One imperfection, by how the machine differs from the perfect one; what is not given, does not.

    Attributes:
        encoder_error: what encoders show too much (n, 6), mm, where they show (n, 6); servos do not see it.
        following_error: how far sliders stop from where they should (n, 6), mm; the encoders show it.
        encoder_noise: what is added to the joint variables of a record only (n, 6), mm.
        shift: what joints and lengths are off.
        ball: where the surface that the gauges touch is off the ball's (n, 3), mm, in the base frame, by
            the platform's rotations (n, 3, 3).
        gauge_error: what gauges read too much (n, 3), mm, where the ball has moved by (n, 3) since zero.
        is_random: whether the platform is elsewhere at every visit of a pose.
        has_memory: whether where it is may depend on where it comes from.
    """

    encoder_error: Callable[[Stops, Array], Array] = _nothing
    following_error: Callable[[Stops], Array] = _nothing
    encoder_noise: Callable[[Stops], Array] = _nothing
    shift: Callable[[Stops, Posture], Shift] = _no_shift
    ball: Callable[[Stops, Array], Array] = _nothing
    gauge_error: Callable[[Stops, Array], Array] = _nothing
    is_random: bool = False
    has_memory: bool = False


def at_once(*effects: Effect, at_work: bool | None = None) -> Effect:
    """Effects at once; if it is said, at work only, or while measuring only."""

    def summed(name: str) -> Callable[..., Any]:
        nothing: Any = Shift() if name == "shift" else NOTHING

        def hook(stops: Stops, *given: object) -> Any:
            if at_work not in {None, stops.at_work}:
                return nothing
            parts = (
                getattr(one, name)(stops.of_effect(number), *given) for number, one in enumerate(effects)
            )
            return sum(parts, start=nothing)

        return hook

    hooks = [one.name for one in fields(Effect) if one.name not in {"is_random", "has_memory"}]
    given: dict[str, Any] = {name: summed(name) for name in hooks}
    is_random, has_memory = (
        any(some) for some in zip(*((one.is_random, one.has_memory) for one in effects), strict=True)
    )
    return Effect(**given, is_random=is_random, has_memory=has_memory)


def in_steps(values: Array, step: float) -> Array:
    """Values rounded to multiples of a step, if there is one."""
    return step * np.round(values / step) if step else values
