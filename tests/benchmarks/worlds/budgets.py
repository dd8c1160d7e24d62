"""Machines whose effects are drawn from the uncertainty budget that is stated of them."""

from collections.abc import Callable, Iterable
from functools import cache

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.cell.uncertainty import Grade, UncertaintySettings
from hexacell.kinematics.rotations import Array
from hexacell.robot.stated import stated_effects
from hexacell.uncertainty.effects import Effect as StatedEffect
from tests.benchmarks.machines import bundled
from tests.benchmarks.worlds import encoders, gauges, legs, rails
from tests.benchmarks.worlds.effects import Effect, at_once
from tests.benchmarks.worlds.legs import Course

Random = np.random.Generator
Draw = Callable[[float, Random], Effect]

GAUGE_SCALE = 0.001
COMPLIANCE = 0.03
"""Of a leg, um/N; this and the next are what a cell file states unless it is told otherwise."""

EXPANSIONS_UM_M_K = (23.0, 23.0, 23.0)
"""Of legs, base with its scales, platform."""

WAVES_MM = (600.0, 1500.0)
UM, PPM, MRAD = 1e-3, 1e-6, 1e-3


@cache
def settings_of(grade: Grade) -> CellSettings:
    """The bundled cell, with gauges as they are and a machine of some grade."""
    settings = bundled().settings
    noise = settings.noise.model_copy(update={"gauge_scale": GAUGE_SCALE})
    stated = UncertaintySettings.model_validate({"grade": grade})
    return settings.model_copy(update={"noise": noise, "uncertainty": stated})


def machine(grade: Grade) -> tuple[StatedEffect, ...]:
    """What is stated of a machine of some grade."""
    return stated_effects(settings_of(grade))


def drawn(stated: Iterable[StatedEffect], factor: float, random: Random) -> Effect:
    """A machine with each of these effects, ``factor`` times as large as it is stated.

    Raises:
        KeyError: there is no such effect here.
    """
    sized = (effect for effect in stated if effect.size)
    return at_once(*(_DRAWS[effect.name](factor * effect.size, random) for effect in sized))


def _directions(mrad: float, random: Random) -> Effect:
    yaw, pitch = mrad * MRAD * random.standard_normal((2, 3))[:, rails.RAILS]
    return rails.not_parallel(yaw, pitch)


def _waves(wave_mm: float) -> Draw:
    def draw(um: float, random: Random) -> Effect:
        phases = random.uniform(0.0, 2.0 * np.pi, (3, 3))[rails.RAILS]
        return rails.wavy(um * UM, wave_mm, np.array([0.0, 1.0, 1.0]), phases)

    return draw


def _warmer(kelvin: float, course: Course) -> Effect:
    leg, base, platform = kelvin * PPM * np.array(EXPANSIONS_UM_M_K)
    return legs.warm(leg * np.ones(6), base, platform, base, course)


def _oval(um: float, random: Random) -> Effect:
    xy, yz, zx, xx, zz = um * UM * np.sqrt(1.5) * random.standard_normal(5)
    form = np.array([[xx, xy, zx], [xy, -xx, yz], [zx, yz, 0.0]]) / 2.0
    return gauges.oval(form + zz / np.sqrt(12.0) * np.diag([-1.0, -1.0, 2.0]))


def _scale(shares: Array) -> Effect:
    return encoders.scale(shares * PPM)


_DRAWS: dict[str, Draw] = {
    "scale common to all encoders": lambda s, r: _scale(s * r.standard_normal() * np.ones(6)),
    "scale of each encoder": lambda s, r: _scale(s * r.standard_normal(6)),
    "repeatability of a slider": lambda s, _: rails.stopping(s * UM, np.array([1.0, 0.0, 0.0])),
    "stops of a slider beside its command": lambda s, _: at_once(
        rails.stopping(s * UM, np.array([1.0, 0.0, 0.0])), at_work=True
    ),
    "direction of each rail": _directions,
    **{f"waves of the rails, {wave:g} mm long": _waves(wave) for wave in WAVES_MM},
    "sag common to all rails": lambda s, r: rails.sagging(s * UM * r.standard_normal() * np.ones(6)),
    "temperature at work": lambda s, r: at_once(
        _warmer(s * r.standard_normal(), Course.STEADY), at_work=True
    ),
    "temperature while measuring": lambda s, r: at_once(
        _warmer(s * r.standard_normal(), Course.CENTRED), at_work=False
    ),
    "load at work": lambda s, r: at_once(
        legs.elastic(COMPLIANCE * UM * np.ones(6), s * r.standard_normal(3), np.zeros(3)), at_work=True
    ),
    "scale of each gauge": lambda s, r: gauges.linear(np.diag(1e-3 * s * r.standard_normal(3))[None]),
    "roundness of the ball": _oval,
    "ball beside the tool's centre": lambda s, r: gauges.ball_elsewhere(s * r.standard_normal(3)),
}
"""By the names of the effects of a budget."""
