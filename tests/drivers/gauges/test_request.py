"""Gauges that are described in the cell file alone: that are asked, and that send by themselves."""

import pytest
from pydantic import ValidationError

from drivers.errors import GaugeAtEnd, GaugeSilent, WrongAnswer
from drivers.gauges.described import ModbusGauge, RequestGauge, StreamGauge
from drivers.gauges.visa import VisaGauge
from drivers.interfaces import GaugeReading
from hexacell.cell.described_devices import ModbusEncoderSettings, RequestSettings, StreamSettings
from hexacell.errors import FileError

ID_H = {
    "ask": "GA01\r\n",
    "answer": r"GN01,([+-]\d{4}\.\d{4})",
    "example": "GN01,+0016.2345\r\n",
    "at_end": r"GA01,ER\d",
}
"""Mitutoyo ID-H, as its manual has the commands."""

AMPLIFIER = {
    "ask": "M0\r\n",
    "answer": r"M0,([+-]\d{8})",
    "example": "M0,+00012345\r\n",
    "ends_with": "\n",
    "mm_per_unit": 0.0001,
}
"""An amplifier that counts tenths of a micrometre."""


@pytest.fixture
async def gauge(links, settings):
    return RequestGauge(settings("request", request=ID_H), links)


async def test_it_is_asked_and_understood_as_described(dialogue, gauge):
    dialogue.expect(*[(b"GA01\r\n", b"GN01,+0016.2345\r\n")] * 3)
    assert (await gauge.open()).description == "gauge by request"
    assert await gauge.read() == GaugeReading(16.2345, "GN01,+0016.2345")
    assert dialogue.settings["baudrate"] == 9600


async def test_a_number_without_a_point_is_counted_in_its_unit(dialogue, links, settings):
    gauge = RequestGauge(settings("request", request=AMPLIFIER, resolution_mm=0.0001), links)
    dialogue.expect(*[(b"M0\r\n", b"M0,-00012345\r\n")] * 4)
    await gauge.open()
    assert (await gauge.read()).value_mm == pytest.approx(-1.2345)


async def test_an_end_of_its_travel_is_told(dialogue, gauge):
    dialogue.expect(*[(b"GA01\r\n", b"GA01,ER2\r\n")] * 2)
    await gauge.open()
    with pytest.raises(GaugeAtEnd, match=r"gauge y: plunger at its end \(GA01,ER2\)"):
        await gauge.read()


@pytest.mark.parametrize("answer", [b"GN02,+0016.2345\r\n", b"GN01,+0016,2345\r\n", b"GN01,\r\n"])
async def test_anything_else_is_asked_for_again_and_then_quoted(dialogue, gauge, answer):
    dialogue.expect(*[(b"GA01\r\n", answer)] * 3)
    with pytest.raises(WrongAnswer, match=r"where protocol request has answers like 'GN01,\+0016.2345"):
        await gauge.open()


async def test_a_gauge_that_is_not_described_is_an_error_of_the_cell_file(links, settings):
    with pytest.raises(FileError, match="gauge y: does not say what is asked and answered"):
        RequestGauge(settings("request"), links)
    with pytest.raises(FileError, match="gauge y: does not say what it sends"):
        StreamGauge(settings("stream"), links)
    with pytest.raises(FileError, match="gauge y: does not say in which register"):
        ModbusGauge(settings("modbus"), links)
    with pytest.raises(FileError, match="gauge y: does not say what is asked"):
        VisaGauge(settings("visa"), links)


@pytest.mark.parametrize(
    ("section", "stated"),
    [
        (RequestSettings, ID_H | {"answer": r"GN01,([+-]\d{4}"}),
        (RequestSettings, ID_H | {"answer": r"GN01,[+-]\d{4}\.\d{4}"}),
        (RequestSettings, ID_H | {"answer": r"(GN01),[+-]\d{4}\.\d{4}"}),
        (RequestSettings, ID_H | {"example": "GN01,16\r\n"}),
        (RequestSettings, ID_H | {"at_end": "("}),
        (StreamSettings, {"answer": r"(?P<channel>\+012)\.34 mm", "example": "+012.34 mm\r\n"}),
        (ModbusEncoderSettings, {"registers": (0, 2, 4, 6, 8, 9)}),
    ],
)
def test_descriptions_that_cannot_be_are_refused(section, stated):
    with pytest.raises(ValidationError):
        section.model_validate(stated)


CALIPER = {"answer": r"([+-]\d{3}\.\d{2}) mm", "example": "+012.34 mm\r\n", "at_end": "----"}
"""What many microcontrollers make of Digimatic."""

RECEIVER = {
    "answer": r"(?P<channel>\d\d):(?P<number>[+-]\d{6})",
    "example": "01:+001234\n",
    "mm_per_unit": 0.001,
}
"""Several gauges that count micrometres behind one receiver."""


@pytest.fixture
async def sender(links, settings):
    return StreamGauge(settings("stream", stream=CALIPER, delay_s=0.0), links)


async def test_it_is_understood_as_described(line, dialogue, sender):
    line.repeats(b"-001.23 mm\r\n")
    assert (await sender.open()).description == "gauge that sends"
    assert (await sender.read()).value_mm == -1.23
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


async def test_without_a_channel_it_has_the_port_alone(line, sender, links, settings):
    line.repeats(b"-001.23 mm\r\n")
    await sender.open()
    with pytest.raises(FileError, match="already belongs to gauge y"):
        await StreamGauge(settings("stream", "z", stream=CALIPER), links).open()


async def test_a_stream_that_stops_names_the_gauge(line, sender):
    line.repeats(b"-001.23 mm\r\n")
    await sender.open()
    line.stops()
    with pytest.raises(GaugeSilent, match=r"gauge y: sends nothing for 0\.05 s on port wire"):
        await sender.check()
