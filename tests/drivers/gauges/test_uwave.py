"""Mitutoyo U-WAVE-R on a line where nobody asks: captured frames, freshness, channels, faults."""

import pytest

from drivers.errors import EmptyChannel, GaugeSilent
from drivers.gauges.uwave import UwaveGauge
from drivers.interfaces import GaugeReading
from drivers.serial.opening import SLICE_S

DELAY_S = 0.02


@pytest.fixture
async def gauge(links, settings):
    return UwaveGauge(settings("uwave", channel=2, delay_s=DELAY_S, timeout_s=0.2), links)


async def test_opening_and_reading_take_what_comes(line, dialogue, gauge):
    line.repeats(b"DT10002-0000001.234M\r")
    assert (await gauge.open()).description == "Mitutoyo U-WAVE"
    assert await gauge.read() == GaugeReading(-1.234, "DT10002-0000001.234M")
    assert dialogue.settings["baudrate"] == 57600
    await gauge.check()


async def test_a_value_from_before_the_reading_began_is_never_taken(line, gauge):
    line.repeats(b"DT10002+0000001.000M\r")
    await gauge.open()
    line.backlog(b"DT10002+0000001.000M\r" * 200 + b"DT10002+000")  # nobody listened during the move
    line.repeats(b"DT10002+0000002.000M\r", first=b"0001.000M\r")
    assert (await gauge.read()).value_mm == 2.0
    line.backlog(b"DT10002+0000002.000M\r" * 200)
    line.repeats(b"DT10002+0000003.000M\r")
    assert (await gauge.read_once()).value_mm == 3.0


async def test_a_value_that_was_still_on_its_way_is_not_taken_either(line, gauge):
    line.repeats(b"DT10002+0000001.000M\r")
    await gauge.open()
    line.at_s(DELAY_S / 2, b"DT10002+0000001.000M\r")
    line.at_s(DELAY_S + 2 * SLICE_S, b"DT10002+0000002.000M\r")
    assert (await gauge.read_once()).value_mm == 2.0


async def test_lines_about_transmitters_and_values_of_others_are_not_its_own(line, gauge):
    line.repeats(b"ST1000100009233899\rDT10001+0000009.000M\rTI1120000009241511\rDT10002+0000001.000M\r")
    await gauge.open()
    assert (await gauge.read()).value_mm == 1.0


async def test_a_transmitter_that_is_off_is_told_from_a_receiver_that_is(line, gauge):
    line.repeats(b"DT10002+0000001.000M\r")
    await gauge.open()
    line.repeats(b"DT10001+0000001.000M\r")
    with pytest.raises(EmptyChannel, match=r"gauge y: channel 2 sends nothing for 0\.2 s, others on"):
        await gauge.read()
    line.stops()
    with pytest.raises(GaugeSilent, match=r"gauge y: sends nothing for 0\.2 s on port wire.*Switch it on"):
        await gauge.read()


async def test_a_damaged_value_that_comes_twice_at_once_confirms_nothing(line, gauge):
    line.repeats(b"DT10002+0000001.000M\r")
    await gauge.open()
    line.repeats(
        b"DT10002+0000001.000M\r", first=b"DT10002+0000005.000M\r" * 2, first_at_s=DELAY_S + SLICE_S
    )
    assert (await gauge.read()).value_mm == 1.0
