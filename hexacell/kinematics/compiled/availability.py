"""Whether the inner loops are compiled: where numba is installed and not forbidden."""

from __future__ import annotations

import os
from functools import cache
from importlib.util import find_spec

VARIABLE = "HEXACELL_COMPILED"
"""Of the environment: ``no`` for numpy alone."""


@cache
def is_compiled() -> bool:
    """Whether compiled loops are used; the first call of each takes seconds, once on a computer."""
    return os.environ.get(VARIABLE, "").lower() not in {"no", "0"} and find_spec("numba") is not None
