"""Probabilities and quantiles of the distributions that statistical tests compare with.

They are SciPy's, which takes a fifth of a second to load: commands that test nothing do without.
"""

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


def chi_square_limit(freedom: float, exceeded: float) -> float:
    """What a chi-square variable with so many degrees of freedom exceeds with a probability."""
    from scipy.special import chdtri  # noqa: PLC0415

    return float(chdtri(freedom, exceeded))


def chi_square_exceedance(freedom: float, value: float) -> float:
    """Probability that such a variable is larger than ``value``."""
    from scipy.special import chdtrc  # noqa: PLC0415

    return float(chdtrc(freedom, value))


def normal_probability(values: Values) -> Values:
    """Probability that a standard normal variable is smaller than each of some values (...)."""
    from scipy.special import ndtr  # noqa: PLC0415

    probability: Values = ndtr(values)
    return probability


def normal_limit(exceeded: float) -> float:
    """What a standard normal variable exceeds with a probability."""
    from scipy.special import ndtri  # noqa: PLC0415

    return -float(ndtri(exceeded))


def student_exceedance(freedom: float, value: float) -> float:
    """Probability that Student's t with so many degrees of freedom is larger than ``value``."""
    from scipy.special import stdtr  # noqa: PLC0415

    return float(stdtr(freedom, -value))


def student_limit(freedom: float, exceeded: float) -> float:
    """What Student's t with so many degrees of freedom exceeds with a probability."""
    from scipy.special import stdtrit  # noqa: PLC0415

    return -float(stdtrit(freedom, exceeded))


def variance_ratio_exceedance(above: float, below: float, value: float) -> float:
    """Probability that a ratio of two mean squares, with so many degrees of freedom each, is larger."""
    from scipy.special import fdtrc  # noqa: PLC0415

    return float(fdtrc(above, below, value))
