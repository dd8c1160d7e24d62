"""Probabilities and quantiles of the distributions that statistical tests compare with.

They are SciPy's, which takes a fifth of a second to load: commands that test nothing do without.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


def _special() -> Any:  # noqa: ANN401 - a module
    from scipy import special  # noqa: PLC0415

    return special


def chi_square_limit(freedom: float, exceeded: float) -> float:
    """What a chi-square variable with so many degrees of freedom exceeds with a probability."""
    return float(_special().chdtri(freedom, exceeded))


def chi_square_exceedance(freedom: float, value: float) -> float:
    """Probability that such a variable is larger than ``value``."""
    return float(_special().chdtrc(freedom, value))


def normal_probability(values: Values) -> Values:
    """Probability that a standard normal variable is smaller than each of some values (...)."""
    probability: Values = _special().ndtr(values)
    return probability


def normal_limit(exceeded: float) -> float:
    """What a standard normal variable exceeds with a probability."""
    return -float(_special().ndtri(exceeded))


def student_exceedance(freedom: float, value: float) -> float:
    """Probability that Student's t with so many degrees of freedom is larger than ``value``."""
    return float(_special().stdtr(freedom, -value))


def student_limit(freedom: float, exceeded: float) -> float:
    """What Student's t with so many degrees of freedom exceeds with a probability."""
    return -float(_special().stdtrit(freedom, exceeded))


def variance_ratio_exceedance(above: float, below: float, value: float) -> float:
    """Probability that a ratio of two mean squares, with so many degrees of freedom each, is larger."""
    return float(_special().fdtrc(above, below, value))
