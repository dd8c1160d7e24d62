"""Scatter between approaches: one pose visited again and again from different directions.

At every visit the gauges see where the ball is, and the encoders where the sliders are. What the encoders
see of the ball's motion is no error of the model. The rest is, for each visit less their mean,

    r = d - G q,      G = dP/dq,      covariance  G diag(s_q^2) G^T + diag(s_d^2)

with the noise of encoders and gauges that is stated for a record. Whether there is more is a chi-square
test. If so, one variance more is estimated by restricted maximum likelihood, for each of four sources:
stops of the sliders that their encoders do not see (play, friction), which act like noise of the encoders,
or a gauge that does not repeat. A gauge is named where it is ten times as likely as the sliders.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc, chdtri

from hexacell.identification.diagnostics.standstill import SIGNIFICANCE
from hexacell.kinematics.rotations import Array

FEWEST_VISITS = 3
"""Fewer visits, the first one included, tell nothing."""
CONFIDENCE = 0.95
GAUGE_ODDS = 10.0
"""How many times as likely as the sliders a gauge must be to be named."""
LARGEST_EXCESS = 1e3
"""Times the stated noise up to which a source is sought."""


class ScatterSource(StrEnum):
    """What does not repeat."""

    SLIDERS = "sliders"
    GAUGE_X = "gauge x"
    GAUGE_Y = "gauge y"
    GAUGE_Z = "gauge z"


GAUGES = (ScatterSource.GAUGE_X, ScatterSource.GAUGE_Y, ScatterSource.GAUGE_Z)


@dataclass(frozen=True, slots=True)
class ApproachScatter:
    """What visits of one pose show of the noise of a record.

    Attributes:
        visits: of the pose, the first one included.
        degrees_of_freedom: of the chi-square.
        ball_mm: how far the ball is from its mean, as the gauges see it (root mean square distance).
        chi_square: of what the encoders do not explain, under the stated noise.
        source: what does not repeat; none where the stated noise explains everything.
        excess_mm: one standard deviation of it beside the stated noise, of a slider or of that gauge.
    """

    visits: int
    degrees_of_freedom: int
    ball_mm: float
    chi_square: float
    source: ScatterSource | None = None
    excess_mm: float = 0.0

    @property
    def ratio(self) -> float:
        """The scatter as a multiple of what the stated noise explains."""
        return float(np.sqrt(self.chi_square / self.degrees_of_freedom))

    @property
    def ratio_at_most(self) -> float:
        """Upper limit of the true multiple, with 95 % confidence."""
        return float(np.sqrt(self.chi_square / chdtri(self.degrees_of_freedom, CONFIDENCE)))


def approach_scatter(
    deviations: Array, joints: Array, by_joints: Array, encoders_mm: Array, gauges_mm: Array
) -> ApproachScatter | None:
    """The scatter of visits of one pose; none with fewer than ``FEWEST_VISITS``.

    Args:
        deviations: of the ball along base x, y, z (m, 3), mm.
        joints: what the encoders showed (m, 6), mm.
        by_joints: derivative G (3, 6) of the ball's position by the joint variables.
        encoders_mm: stated noise of each encoder (6,) in a record.
        gauges_mm: likewise of the gauges (3,).
    """
    if len(deviations) < FEWEST_VISITS:
        return None
    visits = _Visits.of(deviations, joints @ by_joints.T)
    stated = (by_joints * encoders_mm**2) @ by_joints.T + np.diag(gauges_mm**2)
    freedom, chi_square = 3 * visits.freedom, visits.chi_square(stated)
    found = ApproachScatter(len(deviations), freedom, visits.ball_mm, chi_square)
    if float(chdtrc(freedom, chi_square)) >= SIGNIFICANCE:
        return found
    sources = {ScatterSource.SLIDERS: by_joints @ by_joints.T}
    sources |= {source: np.diag(row) for source, row in zip(GAUGES, np.eye(3), strict=True)}
    excesses = {source: _excess(visits, stated, added) for source, added in sources.items()}
    source = max(GAUGES, key=lambda one: excesses[one][0])
    if excesses[source][0] < excesses[ScatterSource.SLIDERS][0] + np.log(GAUGE_ODDS):
        source = ScatterSource.SLIDERS
    return ApproachScatter(
        len(deviations), freedom, visits.ball_mm, chi_square, source, excesses[source][1]
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Visits:
    """Products (3, 3), mm^2, of what the encoders do not explain, less its mean, summed over the visits."""

    products: Array
    freedom: int
    ball_mm: float

    @classmethod
    def of(cls, deviations: Array, explained: Array) -> _Visits:
        around = deviations - deviations.mean(axis=0)
        rest = around - (explained - explained.mean(axis=0))
        freedom = len(deviations) - 1
        return cls(rest.T @ rest, freedom, float(np.sqrt(np.sum(around**2) / freedom)))

    def chi_square(self, covariance: Array) -> float:
        return float(np.trace(np.linalg.solve(covariance, self.products)))

    def log_likelihood(self, covariance: Array) -> float:
        """Restricted, but for a constant."""
        log_det = float(np.linalg.slogdet(covariance)[1])
        return -0.5 * (self.freedom * log_det + self.chi_square(covariance))


def _excess(visits: _Visits, stated: Array, added: Array) -> tuple[float, float]:
    """The largest log likelihood with one more variance, and its standard deviation, mm."""
    unit = float(np.sqrt(np.trace(stated) / np.trace(added)))

    def loss(log_size: float) -> float:
        return -visits.log_likelihood(stated + (unit * np.exp(log_size)) ** 2 * added)

    bound = float(np.log(LARGEST_EXCESS))
    best = minimize_scalar(loss, bounds=(-bound, bound), method="bounded")
    return -float(best.fun), unit * float(np.exp(best.x))
