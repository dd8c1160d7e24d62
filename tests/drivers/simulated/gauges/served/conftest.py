"""Served gauges, opened."""

import pytest

from tests.drivers.simulated.gauges.served.cell import TIMEOUT_S, cell


@pytest.fixture
async def sylvac():
    """Three Sylvac gauges, opened; their drivers do not wait long for an answer."""
    async with cell(["sylvac"] * 3, timeout_s=TIMEOUT_S) as made:
        await made.open()
        yield made
