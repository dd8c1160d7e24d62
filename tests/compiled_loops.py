"""Tests with and without compiled loops, whatever the environment says."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from hexacell.kinematics.compiled.availability import VARIABLE, is_compiled


@contextmanager
def compiled(wanted: bool) -> Iterator[None]:
    """Within it compiled loops are used, or not; the same as when the program starts so."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = "yes" if wanted else "no"
    is_compiled.cache_clear()
    try:
        assert is_compiled() == wanted
        yield
    finally:
        del os.environ[VARIABLE]
        os.environ.update({} if before is None else {VARIABLE: before})
        is_compiled.cache_clear()
