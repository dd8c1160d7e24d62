"""Served gauges, opened."""

import pytest

from tests.drivers.simulated.gauges.served.cell import cell


@pytest.fixture
async def sylvac():
    """Three Sylvac gauges, opened."""
    async with cell(["sylvac"] * 3) as made:
        await made.open()
        yield made
