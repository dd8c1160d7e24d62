"""A Sylvac gauge at the end of a scripted line."""

import pytest

from drivers.gauges.sylvac import SylvacGauge

OPENING = (
    (b"UNI?\r", b"MM\r"),
    (b"CHA?\r", b"CHA+\r"),
    (b"ID?\r", b"SY276\r"),
    (b"MOD?\r", b"NOR\r"),
    (b"STO?\r", b"STO0\r"),
    (b"PRE?\r", b"PRE +0.000\r"),
    (b"BAT?\r", b"BAT1\r"),
)


def opening(**answers):
    """The opening with other answers to some questions."""
    return [(question, answers.get(question[:3].decode(), answer)) for question, answer in OPENING]


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
