"""The run length of a cumulative sum: after how many values it alarms on average, and the limit for that.

The one-sided sum ``C = max(0, C + z - k)`` of independent normal values z alarms when it exceeds h. It is a
Markov process; with its range in ``STATES`` cells of equal width, the mean number of values until the alarm
solves linear equations (Brook and Evans, An approach to the probability distribution of CUSUM run length,
Biometrika 59, 1972, 539-549). The two sides of a two-sided sum never alarm together, so that the inverses
of their run lengths add (Kemp, Journal of the Royal Statistical Society B 23, 1961, 149-153).
"""

from __future__ import annotations

import numpy as np

from hexacell.distributions import normal_probability

STATES = 250
HIGHEST = 20.0
"""Of the limits considered: a sum of values that have a standard deviation of 1."""


def one_sided_run_length(limit: float, reference: float, shift: float = 0.0) -> float:
    """The mean number of values until a sum from 0 exceeds ``limit``.

    Args:
        limit: h, in standard deviations of a value.
        reference: k, what is subtracted from each value: half the shift that is looked for.
        shift: mean of the values.
    """
    width = 2.0 * limit / (2 * STATES - 1)
    centres = width * np.arange(STATES)
    steps = centres[None, :] - centres[:, None] + reference - shift
    stays = normal_probability(steps + 0.5 * width) - normal_probability(steps - 0.5 * width)
    stays[:, 0] = normal_probability(steps[:, 0] + 0.5 * width)
    return float(np.linalg.solve(np.eye(STATES) - stays, np.ones(STATES))[0])


def two_sided_run_length(limit: float, reference: float, shift: float = 0.0) -> float:
    """The same for sums upwards and downwards, whichever alarms first."""
    up, down = (one_sided_run_length(limit, reference, one) for one in (shift, -shift))
    return 1.0 / (1.0 / up + 1.0 / down)


def limit_for_run_length(run_length: float, reference: float, streams: int = 1) -> float:
    """The limit h of two-sided sums over some streams, for one false alarm in ``run_length`` of them all.

    Streams may depend on each other: the rates of their alarms add all the same, or less.
    """

    def excess(limit: float) -> float:
        return float(np.log(two_sided_run_length(limit, reference) / (streams * run_length)))

    from scipy.optimize import brentq  # noqa: PLC0415 - a fifth of a second that only a watch needs

    return float(brentq(excess, 0.1, HIGHEST, xtol=1e-6))
