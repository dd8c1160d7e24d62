"""Texts of identifications whose design is compared with a bound that is searched roughly."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.small_cell import bound_roughly


@pytest.fixture(scope="module", autouse=True)
def rough_bound() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        bound_roughly(patch)
        yield
