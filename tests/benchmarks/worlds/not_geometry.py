"""Machines with backlash, play and compliance by the worlds' own equations, and what is looked for."""

from collections.abc import Mapping

import numpy as np

from hexacell.identification.placement import Weight
from hexacell.identification.terms.backlash import backlash
from hexacell.identification.terms.compliance import compliance
from hexacell.identification.terms.play import play
from hexacell.identification.terms.term import ModelTerm
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot
from tests.benchmarks.worlds import encoders, legs
from tests.benchmarks.worlds.effects import Effect, at_once

NEWTON, DOWN, CENTRE_MM = 100.0, np.array([0.0, 0.0, -1.0]), np.array([5.0, -3.0, 20.0])
NOTHING = np.zeros(6)
STEEL = 11.5e-6
"""Share by which steel grows a kelvin."""


def effect_of(coefficients: Mapping[str, Array], warmer_k: float = 0.0) -> Effect:
    """A machine with coefficients (6,) of each term: mm, mm and um/N; those not named are zero.

    All of it gets warmer by ``warmer_k`` an hour, about what a calibration takes.
    """
    grown = warmer_k * STEEL
    sizes = dict.fromkeys(("backlash", "play", "compliance"), NOTHING) | dict(coefficients)
    return at_once(
        encoders.hysteresis(0.5 * sizes["backlash"]),
        legs.play(0.5 * sizes["play"], NEWTON * DOWN, CENTRE_MM),
        legs.elastic(1e-3 * sizes["compliance"], NEWTON * DOWN, CENTRE_MM),
        legs.warm(np.full(6, grown), grown, grown, grown, legs.Course.RISING),
    )


def terms_of(robot: Robot, centre_mm: Array = CENTRE_MM, newton: float = NEWTON) -> tuple[ModelTerm, ...]:
    """What is looked for on a robot whose owner states that weight, and where it acts."""
    base = robot.mechanism.normalize_frames(robot.drawing)[1].base
    weight = Weight(base @ DOWN, centre_mm)
    return backlash(0.1), play(0.1, weight), compliance(0.3, newton, weight)
