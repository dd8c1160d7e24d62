"""Whether three gauges answer as they are mounted, by what they showed after small known moves.

What the gauges showed per length of a move along each base axis is a matrix, the identity for gauges as
they should be on a perfect robot. How far the ball went is what the encoders show, not what was commanded:
a machine that does not repeat goes elsewhere. Of all assignments of gauges to axes, with either sign, the
one is taken whose axes the gauges followed best, so that no threshold on directions is needed. Next to a
singularity, where the ball may go at 45 degrees to its command, a healthy set resembles one with two
gauges exchanged and one of them reversed: two mistakes at once must be followed distinctly better. At
3,929 references of robots drawn within tolerances of 7 mm the right assignment was then ahead by 0.39 and
more, where 3 is the most.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from itertools import permutations, product

import numpy as np

from hexacell.distributions import variance_ratio_exceedance
from hexacell.kinematics.rotations import Array

AXES = 3
"""Moves of a round, one along each axis."""

CHANCE = 1e-3
"""Probability of healthy gauges to show what is taken for a mistake."""

LEAST_RESPONSE = 0.4
"""Share of the moves that a gauge in mm must show. Healthy ones showed 0.79 of them and more."""

LARGEST_RESPONSE = 30.0
"""Share of the moves above which a gauge answers in micrometres."""

LEAST_RESPONSE_INCHES = 0.027
"""Share of the moves below which a gauge follows nothing. In inches it shows a 25.4th of them."""

TWO_MISTAKES = 0.3
"""How much better a set with exchanged and reversed gauges must explain what was shown."""


class GaugeMistake(StrEnum):
    """What is wrong with a gauge."""

    DEAD = "dead"
    INCHES = "inches"
    MICROMETRES = "micrometres"
    REVERSED = "reversed"
    EXCHANGED = "exchanged"


@dataclass(frozen=True, eq=False)
class GaugeTrial:
    """What three gauges showed after small moves of the ball, a round of three at a time.

    Attributes:
        moved_mm: the moves (n, 3) along base x, y, z, in rows.
        shown_mm: what the gauges x, y, z showed (n, 3) after each of them.
    """

    moved_mm: Array
    shown_mm: Array

    @cached_property
    def response(self) -> Array:
        """What each gauge showed per length of a move along each axis (3, 3), by gauge and axis."""
        return self._fitted[:AXES].T

    @cached_property
    def _fitted(self) -> Array:
        """The response (3, 3), by axis and gauge, and after several rounds the error of the reference."""
        design = self._design if len(self.moved_mm) > AXES else self.moved_mm
        return np.asarray(np.linalg.lstsq(design, self.shown_mm, rcond=None)[0])

    @property
    def _design(self) -> Array:
        return np.concatenate([self.moved_mm, np.ones((len(self.moved_mm), 1))], axis=1)

    @property
    def findings(self) -> dict[GaugeMistake, list[int]]:
        """What is wrong with which gauges, if it is no chance; nothing if they are as they should be."""
        return {} if self.may_be_chance else judge_response(self.response)

    @property
    def may_be_chance(self) -> bool:
        """Whether healthy gauges on this machine may have shown the same; not after a single round."""
        if len(self.moved_mm) <= AXES:
            return False
        unknowns, freedom = self.response.size, self.shown_mm.size - self._fitted.size
        scatter = float(np.sum((self.shown_mm - self._design @ self._fitted) ** 2))
        as_moved = self.shown_mm - self.moved_mm
        beyond = float(np.sum((as_moved - as_moved.mean(axis=0)) ** 2)) - scatter
        if scatter == 0.0:
            return beyond <= 0.0
        ratio = (beyond / unknowns) / (scatter / freedom)
        return variance_ratio_exceedance(unknowns, freedom, ratio) > CHANCE


def judge_response(response: Array) -> dict[GaugeMistake, list[int]]:
    """What is wrong with which gauges, by their response (3, 3); nothing if they are as they should be.

    Gauges have the numbers of their base axes.
    """
    size = np.linalg.norm(response, axis=1)
    # Of fewer than three gauges the axes are less certain: these are judged once the others live.
    if dead := np.flatnonzero(~(size >= LEAST_RESPONSE_INCHES)).tolist():
        return {GaugeMistake.DEAD: dead}
    axes, signs = _best_assignment(response / size[:, None])
    groups = {
        GaugeMistake.INCHES: [gauge for gauge in range(3) if size[gauge] < LEAST_RESPONSE],
        GaugeMistake.MICROMETRES: [gauge for gauge in range(3) if size[gauge] > LARGEST_RESPONSE],
        GaugeMistake.EXCHANGED: [gauge for gauge, axis in enumerate(axes) if gauge != axis],
        GaugeMistake.REVERSED: [gauge for gauge, sign in enumerate(signs) if sign < 0],
    }
    return {mistake: gauges for mistake, gauges in groups.items() if gauges}


def _best_assignment(followed: Array) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The axis that each gauge follows, and its sign, by its response (3, 3) of unit length."""

    def agreement(axes: tuple[int, ...], signs: tuple[int, ...]) -> float:
        agree = float((followed[range(3), axes] * signs).sum())
        return agree - TWO_MISTAKES if axes != (0, 1, 2) and -1 in signs else agree

    every = product(permutations(range(3)), product((1, -1), repeat=3))
    return max(every, key=lambda one: agreement(*one))
