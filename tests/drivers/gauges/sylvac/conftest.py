"""A Sylvac gauge at the end of a scripted line."""

import pytest

from drivers.gauges.sylvac import SylvacGauge
from tests.drivers.gauges.sylvac.dialogue import OPENING


@pytest.fixture
async def gauge(links, settings):
    gauge = SylvacGauge(settings("sylvac"), links)
    yield gauge
    await gauge.close()


@pytest.fixture
async def opened(dialogue, gauge):
    dialogue.expect(*OPENING)
    await gauge.open()
    return gauge
