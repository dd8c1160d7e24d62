"""Noise of one instrument from a series of its readings while nothing moves.

It is noise from reading to reading alone, a lower limit of the scatter of a record. A line is fitted and
subtracted, whose slope is tested (t-test); false readings are found by the generalized extreme studentized
deviate test; successive readings may be correlated (first-order autoregression). A series that shows less
scatter than the steps of the display has the standard deviation of rounding, step / sqrt(12).

Sources: Rosner, Technometrics 25 (1983) 165-172; JCGM 100, F.2.2.1.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.distributions import chi_square_limit, student_exceedance, student_limit
from hexacell.kinematics.rotations import Array, Mask

SMALLEST_SERIES = 8
"""Fewer readings are no series."""
SIGNIFICANCE = 1e-3
"""Probability of each test to find what is not there."""
OUTLIER_SHARE = 0.1
"""Largest share of a series that can be outliers."""
OUTLIER_STEPS = 2.0
"""Steps of the display within which no reading is an outlier."""
CORRELATION_SIGMAS = 2.33
"""Standard deviations below which a correlation counts as zero (one-sided 1 %)."""
LARGEST_CORRELATION = 0.95
USUAL_STEP_MM = 1e-3
"""Step of the display of a dial indicator."""

PADDED = 6
_DECIMALS = re.compile(r"\.(\d+)")


@dataclass(frozen=True, slots=True)
class ReadingNoise:
    """Noise of single readings of one instrument.

    Attributes:
        reading: standard deviation of a reading about the line through the series, outliers left out.
        drift: change over the series, if it is significant; zero otherwise.
        correlation: of successive readings, if it is significantly positive; zero otherwise.
    """

    reading: float
    degrees_of_freedom: int
    drift: float
    outliers: int
    correlation: float

    def of_mean(self, readings: int) -> float:
        """Standard deviation, mm, of the mean of successive readings."""
        lags = np.arange(1, readings)
        related = 2.0 * np.sum((1.0 - lags / readings) * self.correlation**lags)
        return float(self.reading * np.sqrt((1.0 + related) / readings))

    def exceeds(self, stated: float, readings: int, significance: float = SIGNIFICANCE) -> bool:
        """Whether the mean of successive readings is significantly noisier than stated (chi-square)."""
        freedom = self.degrees_of_freedom * (1.0 - self.correlation) / (1.0 + self.correlation)
        most = stated**2 * chi_square_limit(freedom, significance) / freedom
        return self.of_mean(readings) ** 2 > most


def reading_noise(values: Array, step_mm: float) -> ReadingNoise:
    """The noise of a series (n,), mm, of readings at equal intervals from a display of some step.

    Raises:
        ValueError: the series has fewer than ``SMALLEST_SERIES`` readings.
    """
    if len(values) < SMALLEST_SERIES:
        raise ValueError(f"{len(values)} readings are no series")
    kept = _without_outliers(values, step_mm)
    line = _Line.through(values, kept)
    floor = step_mm / np.sqrt(12.0)
    sigma = max(float(np.sqrt(line.squares / line.freedom)), floor)
    correlation = _correlation(line.residuals[kept]) if sigma > floor else 0.0
    slope_sigma = sigma * np.sqrt((1.0 + correlation) / (1.0 - correlation)) / line.lever
    beyond = 2.0 * student_exceedance(line.freedom, abs(line.slope) / slope_sigma)
    drift = line.slope * (len(values) - 1) if beyond < SIGNIFICANCE else 0.0
    outliers = len(values) - int(kept.sum())
    return ReadingNoise(sigma, line.freedom, float(drift), outliers, correlation)


def display_step(answers: Sequence[str]) -> float:
    """The step of a display, mm, by the decimal digits of its answers; ``USUAL_STEP_MM`` without any.

    Firmware that always sends six fills them up with zeros.
    """
    found = [digits[1] for answer in answers if (digits := _DECIMALS.search(answer))]
    most = max((len(one if len(one) < PADDED else one.rstrip("0")) for one in found), default=0)
    return 10.0**-most if most else USUAL_STEP_MM


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    """The straight line through some readings of a series.

    Attributes:
        slope: mm a reading.
        residuals: (n,) of all readings.
        influence: (n,) share of a reading in the line at its own place.
        squares: sum of squares of the residuals of those that it goes through.
        lever: root of the sum of squares of their places.
    """

    slope: float
    residuals: Array
    influence: Array
    squares: float
    freedom: int
    lever: float

    @classmethod
    def through(cls, values: Array, kept: Mask) -> "_Line":
        places = np.arange(len(values)) - np.mean(np.flatnonzero(kept))
        around = values - np.mean(values[kept])
        lever = float(np.sum(places[kept] ** 2))
        slope = float(places[kept] @ around[kept]) / lever
        residuals = around - slope * places
        influence = 1.0 / kept.sum() + places**2 / lever
        squares = float(np.sum(residuals[kept] ** 2))
        return cls(slope, residuals, influence, squares, int(kept.sum()) - 2, float(np.sqrt(lever)))


def _without_outliers(values: Array, step_mm: float) -> Mask:
    """The readings (n,) that are no outliers: of the most extreme ones, removed one by one."""
    kept = found = np.ones(len(values), dtype=bool)
    for _ in range(max(1, int(OUTLIER_SHARE * len(values)))):
        line = _Line.through(values, kept)
        worst = int(np.argmax(np.where(kept, np.abs(line.residuals), -1.0)))
        off = float(abs(line.residuals[worst]))
        # Whether it is farther off than chance explains (Student's t).
        share, readings = 1.0 - line.influence[worst], line.freedom + 2
        variance = (line.squares - off**2 / share) / (line.freedom - 1)
        statistic = off / np.sqrt(max(variance, step_mm**2 / 12.0) * share)
        is_extreme = statistic > student_limit(line.freedom - 1, 0.5 * SIGNIFICANCE / readings)
        is_outlier = is_extreme and off > OUTLIER_STEPS * step_mm
        kept = kept & (np.arange(len(values)) != worst)
        found = kept if is_outlier else found
    return found


def _correlation(residuals: Array) -> float:
    """The correlation of successive residuals, with the bias of a fitted line corrected; zero if chance."""
    count = len(residuals)
    squares = float(residuals @ residuals)
    correlation = float(residuals[1:] @ residuals[:-1]) / squares + 2.0 / count
    if correlation < CORRELATION_SIGMAS / np.sqrt(count):
        return 0.0
    return min(correlation, LARGEST_CORRELATION)
