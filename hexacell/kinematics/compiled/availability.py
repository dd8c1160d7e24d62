"""Whether the inner loops are compiled: where numba is installed and not forbidden."""

from __future__ import annotations

import os
from functools import cache
from importlib.util import find_spec

import numpy as np

from hexacell.kinematics.rotations import Array

VARIABLE = "HEXACELL_COMPILED"
"""Of the environment: ``no`` for numpy alone."""


@cache
def is_compiled() -> bool:
    """Whether compiled loops are used; the first call of each takes seconds, once on a computer."""
    return os.environ.get(VARIABLE, "").lower() not in {"no", "0"} and find_spec("numba") is not None


def own(values: Array) -> Array:
    """Real numbers in the one layout that compiled loops take; a copy if they are not, or read-only."""
    return values if values.flags.carray and values.dtype == float else np.array(values, dtype=float)
