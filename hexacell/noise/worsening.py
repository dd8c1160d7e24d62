"""A machine that gets worse during a run: it comes back to later references less well than to the first.

By an F test of the ends of the later half of the sets against those before and the visits of the first
reference: of what encoders show, and of what gauges show beside them. Known noise explains either.
Components that go together, as by play along a line, are fewer degrees of freedom (Satterthwaite).
"""

from collections.abc import Sequence

import numpy as np

from hexacell.cell.fields import Frozen
from hexacell.distributions import variance_ratio_exceedance
from hexacell.identification.problem.prior import Noise
from hexacell.kinematics.rotations import Array
from hexacell.noise.allowances import ReferenceChange

SIGNIFICANCE = 0.003
"""Probability of each kind, by a machine that stays as it is, below which it got worse."""

AMONG_ENDS = 0.05
"""Likewise of the ends alone: a drift too small to be found makes all larger than visits in short order."""

FEWEST = 2
"""Sets in either half; one set that does not close may be of a gauge that slipped."""


class Worsening(Frozen):
    """How much worse a machine came back later.

    Attributes:
        first_mm: scatter of the ball along an axis (1 sigma) at the first returns to references.
        later_mm: the same at the ends of the later sets, of which there are ``sets``.
        is_seen: whether the encoders show it; else it is between them and the ball.
    """

    first_mm: float
    later_mm: float
    sets: int
    is_seen: bool


def worsening_of(changes: Sequence[ReferenceChange], ends: int, noise: Noise) -> Worsening | None:
    """What got worse; None where chance explains it, or too little was read.

    The ``changes`` are in the order in which they were read; so many of the last are the ``ends`` of sets.
    """
    later = ends - ends // 2
    if ends - later < FEWEST:
        return None
    by_noise = [one.covariance + one.by_drift for one in changes]
    joints, beside = np.array([one.joints for one in changes]), [one.unexplained_mm for one in changes]
    of_noise = np.linalg.solve(np.linalg.cholesky(by_noise), np.array(beside)[..., None])[..., 0]
    kinds = {True: joints / (np.sqrt(2.0) * noise.encoders), False: of_noise}
    is_seen = min(kinds, key=lambda kind: _probability(kinds[kind], later))
    rows = kinds[is_seen]
    if _probability(rows, later) >= SIGNIFICANCE or _probability(rows[-ends:], later) >= AMONG_ENDS:
        return None
    shown = np.array([one.unexplained_mm + one.by_joints @ one.joints for one in changes])
    first, last = (float(np.sqrt(0.5 * np.mean(rows**2))) for rows in np.split(shown, [len(shown) - later]))
    return Worsening(first_mm=first, later_mm=last, sets=later, is_seen=is_seen)


def _probability(rows: Array, later: int) -> float:
    """Probability of so much more in the ``later`` rows, in units of the noise, by chance."""
    count, size = rows.shape
    moments = rows.T @ rows / count
    trace, squares = float(np.trace(moments)), float(np.sum(moments**2))
    # Without what the moments of few rows have by chance.
    of_squares = max((squares - trace**2 / count) / (1.0 + 1.0 / count), trace**2 / size, 1e-300)
    freedom = max(trace**2 / of_squares, 1.0)
    first, last = (max(float(np.mean(part**2)), 1.0) for part in np.split(rows, [count - later]))
    return variance_ratio_exceedance(later * freedom, (count - later) * freedom, last / first)
