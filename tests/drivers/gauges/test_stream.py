"""A gauge that sends by itself and is described in the cell file alone."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import GaugeSilent
from drivers.gauges.described import StreamGauge
from drivers.gauges.streaming import Origin
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.gauges.bank import instrument_class
from drivers.simulated.gauges.instruments import Indicator
from hexacell.cell.described_devices import StreamSettings
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import FileError
from tests.drivers.gauges.conftest import StreamingLine

CALIPER = {"answer": r"([+-]\d{3}\.\d{2}) mm", "example": "+012.34 mm\r\n", "at_end": "----"}
"""What many microcontrollers make of Digimatic."""

RECEIVER = {
    "answer": r"(?P<channel>\d\d):(?P<number>[+-]\d{6})",
    "example": "01:+001234\n",
    "mm_per_unit": 0.001,
}
"""Several gauges that count micrometres behind one receiver."""


@pytest.fixture
def line(dialogue):
    return StreamingLine(dialogue)


@pytest.fixture
async def gauge(links, settings):
    return StreamGauge(settings("stream", stream=CALIPER, delay_s=0.0), links)


async def test_it_is_understood_as_described(line, dialogue, gauge):
    line.repeats(b"-001.23 mm\r\n")
    assert (await gauge.open()).description == "gauge that sends"
    assert (await gauge.read()).value_mm == -1.23
    assert dialogue.settings["baudrate"] == 9600


async def test_gauges_on_one_port_are_told_apart_by_their_channel(line, links, settings):
    line.repeats(b"01:+001000\n02:-002000\n")
    gauges = [
        StreamGauge(settings("stream", name, stream=RECEIVER, channel=n), links)
        for n, name in ((1, "x"), (2, "y"))
    ]
    for gauge in gauges:
        await gauge.open()
    assert [(await gauge.read()).value_mm for gauge in gauges] == [1.0, -2.0]


async def test_without_a_channel_it_has_the_port_alone(line, gauge, links, settings):
    line.repeats(b"-001.23 mm\r\n")
    await gauge.open()
    with pytest.raises(FileError, match="already belongs to gauge y"):
        await StreamGauge(settings("stream", "z", stream=CALIPER), links).open()


async def test_a_stream_that_stops_names_the_gauge(line, gauge):
    line.repeats(b"-001.23 mm\r\n")
    await gauge.open()
    line.stops()
    with pytest.raises(GaugeSilent, match=r"gauge y: sends nothing for 0\.05 s on port wire"):
        await gauge.check()


async def test_a_gauge_that_is_not_described_is_an_error_of_the_cell_file(links, settings):
    with pytest.raises(FileError, match="gauge y: does not say what it sends"):
        StreamGauge(settings("stream"), links)


@given(st.floats(-6.0, 6.0), st.integers(1, 99), st.sampled_from([CALIPER, RECEIVER]))
def test_what_the_simulated_gauge_sends_is_understood(value, channel, description):
    described = StreamSettings(**description)
    [frame] = instrument_class("stream")({channel: Indicator(lambda: value)}, described).unasked()
    gauge = StreamGauge(
        GaugeSettings(name="x", axis="x", protocol="stream", channel=channel, stream=described),
        SharedSerialPorts(),
    )
    assert gauge._origin(frame.strip()) is Origin.OWN
    assert gauge._parse_value(frame.strip()).value == pytest.approx(value, abs=0.0051)
