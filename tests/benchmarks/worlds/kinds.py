"""Kinds of imperfect machines: an effect, its usual size, and what may rightly be said of it.

Sizes are standard deviations where something is drawn for each leg or point, and amplitudes where it is
not. The usual ones are those of a cell with glass scales and precision guides; where no such figure
exists, what a careful shop would reach.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hexacell.identification.solver.result import DataFaultKind
from hexacell.kinematics.rotations import Array, skew
from tests.benchmarks.worlds import budgets, encoders, gauges, legs, rails
from tests.benchmarks.worlds.effects import MOVE_GAUGES_HOURS, RECORD_HOURS, Effect, at_once
from tests.benchmarks.worlds.legs import Course

Random = np.random.Generator
Make = Callable[[float, Random], Effect]
Draw = Callable[[Random], Array]
"""A number (6,) for each leg."""

UM = 1e-3
PPM = 1e-6
MRAD = 1e-3
DEG = float(np.radians(1.0))

STATED_MM = 0.01
"""Noise of encoders and gauges that the simulated cell states."""

POINTS = 8
ALUMINIUM, STEEL, GRANITE = 23e-6, 11.5e-6, 6e-6
DOWN = np.array([0.0, 0.0, -1.0])
CENTRE = np.array([10.0, -5.0, -90.0])
"""Of mass, in the platform frame: above the ball, and not quite in the middle."""

ARM = np.array([0.0, 20.0, 60.0])
"""From a rail to the joints on its sliders."""

X, Y, Z = np.eye(3)
EVERY = np.ones(3)

PRECISION, ORDINARY = "all of the budget, precision machine", "all of the budget, ordinary one"
NONE = "no effect"

GROSS = frozenset({DataFaultKind.GROSS_ERROR})
SHIFT = frozenset({DataFaultKind.ZERO_SHIFT, DataFaultKind.GROSS_ERROR})


@dataclass(frozen=True)
class Kind:
    """One kind of world.

    Attributes:
        usual: the usual size, in ``unit``.
        make: the effect of a size in that unit.
        hidden: whether no record can show it.
        faults: data faults that are rightly named; any other is a wrong one.
    """

    name: str
    unit: str
    usual: float
    make: Make
    hidden: bool = False
    faults: frozenset[DataFaultKind] = frozenset()

    def world(self, factor: float, random: Random) -> Effect:
        """The effect at a multiple of its usual size."""
        return self.make(factor * self.usual, random)


def each(random: Random) -> Array:
    """A number (6,) for each leg."""
    return random.standard_normal(6)


def per_rail(random: Random) -> Array:
    """A number (6,) for each leg, the same for two on one rail."""
    drawn: Array = random.standard_normal(3)[rails.RAILS]
    return drawn


def one(random: Random) -> Array:
    """A number (6,) for one leg only."""
    alone: Array = (np.arange(6) == random.integers(6)) * random.choice([-1.0, 1.0])
    return alone


def direction(random: Random) -> Array:
    """A unit vector (3,)."""
    drawn = random.standard_normal(3)
    unit: Array = drawn / np.linalg.norm(drawn)
    return unit


def phases(random: Random, *shape: int) -> Array:
    return random.uniform(0.0, 2.0 * np.pi, shape)


def hour(random: Random) -> float:
    """Between two records of one point in the middle of a campaign of five points with eleven records."""
    point, record = int(random.integers(5)), float(random.integers(3, 9))
    return (11 * point + record + 0.5) * RECORD_HOURS + point * MOVE_GAUGES_HOURS


def wavy(wave_mm: float, directions: Array, *, of_rails: bool = False) -> Make:
    """The ways of sliders; those on one rail may have the same."""

    def make(size: float, random: Random) -> Effect:
        drawn = phases(random, 3, 3)[rails.RAILS] if of_rails else phases(random, 6, 3)
        return rails.wavy(size * UM, wave_mm, directions, drawn)

    return make


def run_out(size: float, random: Random) -> Effect:
    return legs.run_out(size * UM, 3.0 * random.standard_normal((6, 3)), phases(random, 6, 3))


def alike(_: Random) -> Array:
    """The same (6,) for all legs."""
    return np.ones(6)


def nothing(_: Random) -> Array:
    return np.zeros(6)


def not_parallel(yaw: Draw, pitch: Draw) -> Make:
    return lambda size, random: rails.not_parallel(size * MRAD * yaw(random), size * MRAD * pitch(random))


def elastic(weight_n: float) -> Make:
    return lambda size, _: legs.elastic(size * UM * np.ones(6), weight_n * DOWN, CENTRE)


def warm(
    share: float,
    base: float = 0.0,
    platform: float = 0.0,
    course: Course = Course.STEADY,
    of_legs: Draw = alike,
) -> Make:
    """So many K warmer: shares a K of legs, base and platform."""
    return lambda size, random: legs.warm(
        size * share * of_legs(random), size * base, size * platform, size * base, course
    )


def at_work(make: Make) -> Make:
    """Only while nothing is measured."""
    return lambda size, random: at_once(make(size, random), at_work=True)


def load(compliance: float) -> Make:
    """A force of so many N along each axis on the tool, one sigma; legs yield ``compliance``, um/N."""
    return lambda size, random: legs.elastic(
        compliance * UM * np.ones(6), size * random.standard_normal(3), np.zeros(3)
    )


def linear(unit: float, draw: Callable[[Random], Array]) -> Make:
    """What gauges read too much of the displacement: matrices (3, 3) or (n, 3, 3), one for each point."""
    return lambda size, random: gauges.linear((size * unit * draw(random)).reshape(-1, 3, 3))


def not_square(random: Random) -> Array:
    """Each gauge's direction leans by a vector of its own: (3, 3), nothing on the diagonal."""
    drawn = random.standard_normal((3, 3))
    lean: Array = drawn - np.diag(np.diag(drawn))
    return lean


def noise_added(size: float) -> float:
    """With which an instrument is as noisy as ``1 + size`` times what is stated, mm."""
    return STATED_MM * float(np.sqrt((1.0 + size) ** 2 - 1.0))


def together(*names: str) -> Make:
    """Some kinds, all at ``size`` times what is usual."""
    return lambda size, random: at_once(*(KINDS[name].world(size, random) for name in names))


_NONE = [Kind(NONE, "", 1, lambda _size, _random: Effect())]

_ENCODERS = [
    Kind("encoders, common scale", "ppm", 15, lambda s, _: encoders.scale(s * PPM * np.ones(6)), True),
    Kind("encoders, each its scale", "ppm", 10, lambda s, r: encoders.scale(s * PPM * each(r))),
    Kind("encoders, scale bent", "um", 5, lambda s, r: encoders.curved(s * UM * each(r))),
    Kind("encoders, interpolation 2 mm", "um", 1, lambda s, r: encoders.periodic(s * UM, 2, phases(r, 6))),
    Kind("encoders, zeros off", "um", 30, lambda s, r: encoders.offset(s * UM * each(r))),
    Kind("encoders, zeros creep", "um/h", 3, lambda s, r: encoders.creep(s * UM * each(r))),
    Kind("encoders, counts lost", "um", 10, lambda s, r: encoders.lost_counts(s * UM * one(r), hour(r))),
    Kind("encoders, resolution", "um", 5, lambda s, _: encoders.resolution(s * UM)),
    Kind("encoders, noisier", "times more", 0.2, lambda s, _: encoders.more_noise(noise_added(s))),
    Kind("encoders, 1 % outliers", "um", 50, lambda s, _: encoders.outliers(s * UM), faults=GROSS),
]

_RAILS = [
    Kind("rails wavy y, 600 mm", "um", 3, wavy(600, Y)),
    Kind("rails wavy y, 2000 mm", "um", 5, wavy(2000, Y)),
    Kind("rails wavy z, 150 mm", "um", 3, wavy(150, Z)),
    Kind("rails wavy z, 1500 mm", "um", 5, wavy(1500, Z)),
    Kind("rails wavy xyz, 600 mm", "um", 3, wavy(600, EVERY)),
    Kind("three rails wavy yz, 1500 mm", "um", 5, wavy(1500, Y + Z, of_rails=True)),
    Kind("rails sag alike", "um", 20, lambda s, _: rails.sagging(s * UM * np.ones(6)), True),
    Kind("three rails sag, each", "um", 5, lambda s, r: rails.sagging(s * UM * per_rail(r))),
    Kind("three rails yaw, each", "mrad", 0.02, not_parallel(per_rail, nothing)),
    Kind("three rails pitch, each", "mrad", 0.02, not_parallel(nothing, per_rail)),
    Kind("rails yaw and pitch, each", "mrad", 0.02, not_parallel(each, each)),
    Kind("rails twisted, arm 60 mm", "mrad", 0.05, lambda s, r: rails.twisted(s * MRAD * per_rail(r), ARM)),
    Kind("sliders nod", "mrad", 0.03, lambda s, r: rails.nodding(s * MRAD, 600, 60, phases(r, 6))),
    Kind("rails, a bump each", "um", 3, lambda s, r: rails.bump(s * UM, 40, r.uniform(-600, 600, 6))),
    Kind("rails yield", "um/N", 0.02, lambda s, _: rails.yielding(s * UM * np.ones(6), 20 * DOWN, CENTRE)),
]

_SLIDERS = [
    Kind("sliders do not repeat x", "um", 2, lambda s, _: rails.stopping(s * UM, X)),
    Kind("sliders do not repeat xyz", "um", 2, lambda s, _: rails.stopping(s * UM, EVERY)),
    Kind("sliders stop elsewhere, seen", "um", 5, lambda s, _: rails.following(s * UM)),
    Kind("backlash by direction", "um", 2, lambda s, _: encoders.hysteresis(s * UM)),
    Kind("play of legs by load", "um", 2, lambda s, _: legs.play(s * UM, 20 * DOWN, CENTRE)),
]

_LEGS = [
    Kind("legs elastic, 20 N", "um/N", 0.03, elastic(20)),
    Kind("legs elastic, 100 N", "um/N", 0.03, elastic(100)),
    Kind("joints run out, platform", "um", 2, run_out),
    Kind("axes of joints apart", "um", 10, lambda s, r: legs.axes_apart(s * UM * each(r))),
    Kind("legs warmer, steel", "K", 1, warm(STEEL)),
    Kind("legs differ in temperature", "K", 0.3, warm(STEEL, of_legs=each)),
    Kind("all warmer, granite base", "K", 1, warm(ALUMINIUM, GRANITE, ALUMINIUM)),
    Kind("legs get warmer steadily", "K/h", 1, warm(STEEL, course=Course.RISING)),
    Kind("all get warmer steadily", "K/h", 1, warm(ALUMINIUM, GRANITE, ALUMINIUM, Course.RISING)),
    Kind("legs warmer at work", "K", 1, at_work(warm(STEEL)), hidden=True),
    Kind("all warmer at work", "K", 1, at_work(warm(ALUMINIUM, GRANITE, ALUMINIUM)), hidden=True),
    Kind("load at work", "N", 20, at_work(load(0.03)), hidden=True),
    Kind("legs creep, each", "um/h", 3, lambda s, r: legs.growing(s * UM * each(r))),
    Kind("a leg slips once", "um", 10, lambda s, r: legs.growing(s * UM * one(r), hour(r))),
]

_BALL = [
    Kind("ball out of round, order 2", "um", 2, lambda s, r: gauges.out_of_round(s * UM, direction(r), 2)),
    Kind("ball out of round, order 3", "um", 2, lambda s, r: gauges.out_of_round(s * UM, direction(r), 3)),
    Kind("ball and tool off", "um", 300, lambda s, r: gauges.tool_elsewhere(s * UM * direction(r))),
    Kind("ball off the tool", "um", 20, lambda s, r: gauges.ball_elsewhere(s * UM * direction(r)), True),
    Kind(
        "ball slips once",
        "um",
        10,
        lambda s, r: gauges.ball_moves(s * UM * direction(r), hour(r)),
        faults=SHIFT,
    ),
    Kind("ball creeps", "um/h", 5, lambda s, r: gauges.ball_moves(s * UM * direction(r))),
    Kind("ball's stem bends", "per mille", 1, lambda s, _: gauges.stem_bends(1e-3 * s)),
]

_GAUGES = [
    Kind("gauges, each its scale", "per mille", 1, linear(1e-3, lambda r: np.diag(r.standard_normal(3)))),
    Kind("gauges, scale bent", "um", 2, lambda s, r: gauges.bent(s * UM * r.standard_normal(3))),
    Kind("gauges, periodic 1 mm", "um", 2, lambda s, r: gauges.periodic(s * UM, 1.0, phases(r, 3))),
    Kind("gauges, hysteresis", "um", 2, lambda s, _: gauges.hysteresis(s * UM)),
    Kind("triad turned", "deg", 0.3, linear(DEG, lambda r: -skew(r.standard_normal((1, 3))))),
    Kind(
        "triad turned, each point", "deg", 0.3, linear(DEG, lambda r: -skew(r.standard_normal((POINTS, 3))))
    ),
    Kind("plungers not square", "deg", 0.1, linear(DEG, not_square)),
    Kind("gauges noisier", "times more", 0.2, lambda s, _: gauges.more_noise(noise_added(s) * EVERY)),
    Kind("one gauge noisier", "times more", 0.5, lambda s, _: gauges.more_noise(noise_added(s) * X)),
    Kind(
        "gauges, long tails", "times more", 0.2, lambda s, _: gauges.more_noise(noise_added(s) * EVERY, 3.0)
    ),
    Kind("gauges, 1 % outliers", "um", 50, lambda s, _: gauges.outliers(s * UM), faults=GROSS),
    Kind("stands drift", "um/h", 10, lambda s, r: gauges.drifting(s * UM * r.standard_normal((POINTS, 3)))),
    Kind(
        "stands turn", "mrad/h", 0.05, lambda s, r: gauges.turning(s * MRAD * r.standard_normal(3), 200 * Z)
    ),
    Kind(
        "a stand is pushed",
        "um",
        10,
        lambda s, r: gauges.jump(s * UM * direction(r), hour(r)),
        faults=SHIFT,
    ),
]

_TOGETHER = [
    Kind(PRECISION, "times", 1, lambda s, r: budgets.drawn(budgets.machine("precision"), s, r)),
    Kind(ORDINARY, "times", 1, lambda s, r: budgets.drawn(budgets.machine("ordinary"), s, r)),
    Kind("encoders' scale and waves", "times", 1, together(
        "encoders, each its scale", "rails wavy y, 600 mm", "rails wavy z, 1500 mm",
    )),
    Kind("a warm day", "times", 1, together(
        "all get warmer steadily", "stands drift", "legs differ in temperature",
    )),
    Kind("worn sliders", "times", 1, together(
        "backlash by direction", "sliders do not repeat xyz", "rails, a bump each",
    )),
    Kind("poor gauges", "times", 1, together(
        "gauges, each its scale", "plungers not square", "gauges, hysteresis", "triad turned, each point",
    )),
    Kind("heavy tool", "times", 1, together(
        "legs elastic, 100 N", "rails yield", "play of legs by load",
    )),
]  # fmt: skip

KINDS = {
    kind.name: kind
    for group in (_NONE, _ENCODERS, _RAILS, _SLIDERS, _LEGS, _BALL, _GAUGES, _TOGETHER)
    for kind in group
}
"""All kinds by their names."""
