"""Scatter between approaches: one pose visited again and again from different directions.

What the encoders see of the ball's motion is no error of the model: it shows how far the joints stop beside
their commands. The rest is, for each visit less their mean, ``r = d - G q`` with ``G = dP/dq``, whose
covariance follows from the noise of encoders and gauges that is stated for a record, and from what is not
known of G (:mod:`.ball_by_encoders`). Whether there is more is a chi-square test. Where it comes from, ball
and joints show together: with stops s, play p, and errors e and g of encoders and gauges,

    q = s + e,      d = G (s + p) + g.

For each source one variance more is estimated by restricted maximum likelihood, with that of the stops
(``docs/method.md``, Noise).
"""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from hexacell.cell.fields import Frozen
from hexacell.distributions import chi_square_exceedance, chi_square_limit
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.rotations import Array
from hexacell.noise.ball_by_encoders import BallByEncoders
from hexacell.noise.standstill import SIGNIFICANCE

FEWEST_VISITS = 3
"""Fewer visits, the first one included, show nothing."""
CONFIDENCE = 0.95
SEEN = 0.05
"""Probability of the encoders' noise below which joints are said to stop beside their commands."""
INSTRUMENT_ODDS = 10.0
"""How many times as likely as all joints or encoders a single instrument must be to be named."""
LARGEST_EXCESS = 1e3
"""Times the stated noise up to which sizes are sought."""
ROUGH = 1e-2
"""Accuracy of the logarithm of the excess."""
STOP_SIZES = 100
"""Sizes of the scatter of the stops that are tried, evenly spaced by their logarithms."""


class ScatterSource(StrEnum):
    """What does not repeat."""

    JOINTS = "joints"
    ENCODERS = "encoders"
    GAUGE_X = "gauge x"
    GAUGE_Y = "gauge y"
    GAUGE_Z = "gauge z"
    ENCODER_1 = "encoder 1"
    ENCODER_2 = "encoder 2"
    ENCODER_3 = "encoder 3"
    ENCODER_4 = "encoder 4"
    ENCODER_5 = "encoder 5"
    ENCODER_6 = "encoder 6"

    def instruments(self, encoders: int) -> Array:
        """Which of gauges x, y, z and so many encoders it is noise of: (3 + J,), 1 or 0."""
        if self in TOGETHER:
            return np.repeat([0.0, 1.0], [3, encoders])
        return np.asarray(np.eye(3 + encoders)[ALONE.index(self)])


TOGETHER = (ScatterSource.JOINTS, ScatterSource.ENCODERS)
ALONE = tuple(source for source in ScatterSource if source not in TOGETHER)


class RepeatedApproaches(Frozen):
    """What visits of one pose from different directions show of the noise of a record.

    Attributes:
        visits: of the pose, the first one included.
        ball_mm: how far the ball is from its mean, as the gauges see it (root mean square distance).
        ratio: of what the encoders do not explain to what the stated noise explains.
        ratio_as_drawn: likewise, were the geometry exactly as drawn.
        source: what does not repeat beyond that; None where the stated noise explains everything.
        excess: one standard deviation of it beside the stated noise, of each joint or encoder or of
            the instrument, in ``unit``.
        stops: one standard deviation of where a joint stops, as its encoder shows it, less the noise of
            the encoders; zero unless they see more than that. In ``stop_unit``.
    """

    visits: int
    degrees_of_freedom: int
    ball_mm: float
    ratio: float
    ratio_as_drawn: float | None = None
    source: ScatterSource | None = None
    unit: JointUnit = JointUnit.MM
    excess: float = 0.0
    stops: float = 0.0
    stop_unit: JointUnit = JointUnit.MM

    @property
    def ratio_at_most(self) -> float:
        """Upper limit of the true ratio, with 95 % confidence."""
        freedom = self.degrees_of_freedom
        ratio = self.ratio if self.ratio_as_drawn is None else self.ratio_as_drawn
        return ratio * float(np.sqrt(freedom / chi_square_limit(freedom, CONFIDENCE)))


def approach_scatter(
    deviations: Array,
    joints: Array,
    ball: BallByEncoders,
    encoders: Array,
    gauges_mm: Array,
    joint_unit: JointUnit = JointUnit.MM,
) -> RepeatedApproaches | None:
    """The scatter of m visits of one pose; None with fewer than ``FEWEST_VISITS``.

    By ``deviations`` of the ball along base x, y, z (m, 3), mm, and what the encoders showed, ``joints``
    (m, J). ``encoders`` (J,) and ``gauges_mm`` (3,) are their stated noise in a record.
    """
    if len(deviations) < FEWEST_VISITS:
        return None
    shown = np.concatenate([deviations, joints], axis=1)
    around = shown - shown.mean(axis=0)
    instruments = np.diag(np.concatenate([gauges_mm, encoders]) ** 2)
    stated = instruments.copy()
    stated[:3, :3] += ball.covariance(around[:, 3:]).sum(axis=0) / (len(shown) - 1)
    visits = _Visits(
        products=around.T @ around,
        motion=np.concatenate([ball.by_joints, np.eye(joints.shape[1])]),
        stated=stated,
        freedom=len(shown) - 1,
    )
    freedom, chi_square = 3 * visits.freedom, visits.unexplained()
    found = RepeatedApproaches(
        visits=len(deviations),
        degrees_of_freedom=freedom,
        ball_mm=float(np.sqrt(np.trace(visits.products[:3, :3]) / visits.freedom)),
        ratio=float(np.sqrt(chi_square / freedom)),
        ratio_as_drawn=float(np.sqrt(replace(visits, stated=instruments).unexplained() / freedom)),
        stops=_stops(visits, encoders**2),
        stop_unit=joint_unit,
    )
    if chi_square_exceedance(freedom, chi_square) >= SIGNIFICANCE:
        return found
    single = ALONE[: len(instruments)]
    excesses = {source: visits.excess(source) for source in (*TOGETHER, *single)}
    together = max(TOGETHER, key=lambda one: excesses[one][0])
    alone = max(single, key=lambda one: excesses[one][0])
    is_alone = excesses[alone][0] >= excesses[together][0] + np.log(INSTRUMENT_ODDS)
    source = alone if is_alone else together
    concerned = source.instruments(joints.shape[1])
    unit, excess = JointUnit.MM if concerned[:3].any() else joint_unit, excesses[source][1]
    by_encoders = 0.0 if source is ScatterSource.JOINTS else excess**2 * concerned[3:]
    stops = _stops(visits, encoders**2 + by_encoders)
    return found.model_copy(update={"source": source, "unit": unit, "excess": excess, "stops": stops})


def _stops(visits: "_Visits", variances: Array) -> float:
    """One standard deviation of where a joint stops; zero where the variances of encoders explain it."""
    squares, freedom = np.diag(visits.products)[3:], visits.freedom
    if chi_square_exceedance(len(squares) * freedom, float(np.sum(squares / variances))) >= SEEN:
        return 0.0
    return float(np.sqrt(max(0.0, float(np.mean(squares / freedom - variances)))))


@dataclass(frozen=True, slots=True, eq=False)
class _Visits:
    """Visits of one pose, one more than ``freedom``.

    Attributes:
        products: (3 + J, 3 + J), mm^2, of ball and joints less their means, summed over the visits.
        motion: (3 + J, J) of ball and encoders by the stops of the joints.
        stated: (3 + J, 3 + J) covariance of the instruments.
    """

    products: Array
    motion: Array
    stated: Array
    freedom: int

    def unexplained(self) -> float:
        """Chi-square of what the encoders do not explain, which no stop of the joints changes."""
        rest = np.concatenate([np.eye(3), -self.motion[:3]], axis=1)
        covariance, products = rest @ self.stated @ rest.T, rest @ self.products @ rest.T
        return float(np.trace(np.linalg.solve(covariance, products)))

    def excess(self, source: ScatterSource) -> tuple[float, float]:
        """The largest log likelihood with one more variance, and its standard deviation, mm."""
        from scipy.optimize import minimize_scalar  # noqa: PLC0415 - its import takes half a second

        concerned = source.instruments(self.motion.shape[1])
        added = np.diag(concerned)
        if source is ScatterSource.JOINTS:
            moved = np.concatenate(
                [self.motion[:3], np.zeros((len(self.motion) - 3, self.motion.shape[1]))]
            )
            added = moved @ moved.T
        unit = float(np.sqrt(np.diag(self.stated)[concerned > 0.0].mean()))

        def loss(log_size: float) -> float:
            return -self._best_stops(self.stated + (unit * np.exp(log_size)) ** 2 * added, unit)

        bound = float(np.log(LARGEST_EXCESS))
        best = minimize_scalar(loss, bounds=(-bound, bound), method="bounded", options={"xatol": ROUGH})
        return -float(best.fun), unit * float(np.exp(best.x))

    def _best_stops(self, covariance: Array, unit: float) -> float:
        """The restricted log likelihood, but for a constant, with the likeliest scatter of the stops.

        In the coordinates in which both covariances are diagonal it is a sum.
        """
        from scipy.linalg import eigh  # noqa: PLC0415 - as slow to import, and as seldom needed

        shares, axes = eigh(self.motion @ self.motion.T, covariance)
        squares = np.einsum("ij,ik,kj->j", axes, self.products, axes)
        bound = np.log(LARGEST_EXCESS)
        sizes = (unit * np.exp(np.linspace(-bound, bound, STOP_SIZES))) ** 2
        variances = 1.0 + sizes[:, None] * np.maximum(shares, 0.0)
        log_dets = np.linalg.slogdet(covariance)[1] + np.log(variances).sum(axis=1)
        return float(np.max(-0.5 * (self.freedom * log_dets + (squares / variances).sum(axis=1))))
