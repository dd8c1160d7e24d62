"""A shorter time-out for the samples of an open bank of encoders, for tests in which a node is silent."""

from collections.abc import Iterator
from contextlib import contextmanager

from drivers.encoders.cia406 import Cia406Bank


@contextmanager
def short_timeout(bank: Cia406Bank, timeout_s: float = 0.1) -> Iterator[None]:
    assert bank._session is not None
    sampler = bank._session._sampler
    before, sampler._timeout_s = sampler._timeout_s, timeout_s
    yield
    sampler._timeout_s = before
