"""Displays and adapters of which only the value is asked, in dialogues as their manuals have them."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import EmptyChannel, GaugeAtEnd, WrongAnswer, WrongSetting, ZeroVoid
from drivers.gauges.cdi import CdiGauge
from drivers.gauges.digimatic_usb import DigimaticUsbGauge
from drivers.gauges.heidenhain_nd import HeidenhainGauge
from drivers.gauges.keyence_dl_rs1a import KeyenceGauge
from drivers.gauges.mitutoyo_id_h import IdHGauge
from drivers.gauges.mux10 import MultiplexerBusy, Mux10Gauge
from drivers.gauges.protocol import FrameRejected
from drivers.gauges.sylvac import SylvacGauge
from drivers.interfaces import GaugeReading
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.gauges.bank import instrument_class
from drivers.simulated.gauges.instruments import Indicator
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError, HexacellError

ID_H = (IdHGauge, "mitutoyo-id-h", b"GA07\r\n")
ND = (HeidenhainGauge, "heidenhain-nd", b"\x02")
KEYENCE = (KeyenceGauge, "keyence-dl-rs1a", b"M0\r\n")
DIGIMATIC = (DigimaticUsbGauge, "digimatic-usb", b"\n")
TWINS = (
    *(ID_H, ND, KEYENCE, DIGIMATIC),
    *((SylvacGauge, "sylvac", b"?\r"), (CdiGauge, "cdi", b"R\r"), (Mux10Gauge, "mux10", b"7\r")),
)

VALUES = [
    (ID_H, 7, b"GN07,+0016.2345\r\n", 16.2345),
    (ID_H, 7, b"GN07,-0000.0005\r\n", -0.0005),
    (ND, 1, b"-      5.23  =A\r\n", -5.23),
    (ND, 1, b"\r\n+    5.2305    \r\n", 5.2305),
    (ND, 1, b"-    0.0001   \r\n", -0.0001),
    (KEYENCE, 1, b"M0,+001.2345\r\n", 1.2345),
    (KEYENCE, 3, b"M0,+001.2345,-000.0010,-012.0000\r\n", -12.0),
    (DIGIMATIC, 1, b"-1.234\n", -1.234),
    (DIGIMATIC, 1, b"12.34\r\n", 12.34),
    (DIGIMATIC, 1, b"1.234000\n", 1.234),  # open firmware always sends six decimals
    (DIGIMATIC, 1, b"-1.23400\n", -1.234),  # and some five: decimals are no unit
]

FAULTS = [
    (ID_H, 7, b"GX07,+0016.2345\r\n", WrongSetting, "gauge y: shows its maximum. Set it to normal"),
    (ID_H, 7, b"GN07,+000.63956\r\n", WrongSetting, "gauge y: answers in inch"),
    (ID_H, 7, b"GN08,+0016.2345\r\n", WrongAnswer, "where protocol mitutoyo-id-h has answers like"),
    (ND, 1, b'-   0.20591 "=A\r\n', WrongSetting, "gauge y: answers in inch"),
    (ND, 1, b"-      5.23  =D\r\n", WrongSetting, r"result of a series of measurements \(D\)"),
    (ND, 1, b"-      5.23 ?=A\r\n", ZeroVoid, "gauge y: has lost the signal of its probe"),
    (ND, 1, b"-     5.23  =A\r\n", WrongAnswer, "where protocol heidenhain-nd has answers like"),
    (KEYENCE, 3, b"M0,+001.2345,-000.0010\r\n", EmptyChannel, "has channel 3, where 2 amplifiers answer"),
    (KEYENCE, 1, b"M0,+999.9999\r\n", GaugeAtEnd, r"gauge y: shows \+999\.9999, no value"),
    (KEYENCE, 1, b"ER,M0,29\r\n", DeviceError, "gauge y: reports error 29 instead of its value"),
    (KEYENCE, 1, b"M0,+01.2345\r\n", WrongAnswer, "where protocol keyence-dl-rs1a has answers like"),
    (DIGIMATIC, 1, b"# timeout\n", DeviceError, "gauge y: its adapter reports: timeout"),
    (DIGIMATIC, 1, b"0.12345\n", WrongSetting, "gauge y: shows 5 decimals .* in/mm key"),
    (DIGIMATIC, 1, b"hello\n", WrongAnswer, "where protocol digimatic-usb has answers like"),
]


@pytest.mark.parametrize(("instrument", "channel", "frame", "value"), VALUES)
async def test_it_is_asked_and_read(dialogue, links, settings, instrument, channel, frame, value):
    factory, protocol, request = instrument
    gauge = factory(settings(protocol, channel=channel), links)
    dialogue.expect(*[(request, frame)] * 3)
    await gauge.open()
    reading = await gauge.read()
    assert reading == GaugeReading(value, reading.raw)
    assert reading.raw in frame.decode()


@pytest.mark.parametrize(("instrument", "channel", "frame", "error", "message"), FAULTS)
async def test_what_is_no_value_is_told(
    dialogue, links, settings, instrument, channel, frame, error, message
):
    factory, protocol, request = instrument
    gauge = factory(settings(protocol, channel=channel, resolution_mm=None), links)
    good = next(frame for one, place, frame, _ in VALUES if one is instrument and place == channel)
    dialogue.expect((request, good))
    await gauge.open()
    dialogue.expected += [(request, frame)] * 3
    with pytest.raises(error, match=message):
        await gauge.read()
    dialogue.expected.clear()


@pytest.mark.parametrize("resolution", [None, 0.001])
@pytest.mark.parametrize("end", ["00", "000"])
async def test_zeros_behind_the_resolution_are_no_other_unit(dialogue, links, settings, resolution, end):
    gauge = DigimaticUsbGauge(settings("digimatic-usb", resolution_mm=resolution), links)
    dialogue.expect(*[(b"\n", f"-1.234{end}\n".encode())] * (3 if resolution is None else 4))
    await gauge.open()
    assert (await gauge.read()).value_mm == -1.234


@pytest.mark.parametrize("frame", [b"-0.048583\n", b"-0.04858\n", b"-1.23\n"])
async def test_digits_behind_the_resolution_are_another_display(dialogue, links, settings, frame):
    gauge = DigimaticUsbGauge(settings("digimatic-usb", resolution_mm=0.001), links)
    dialogue.expect(*[(b"\n", frame)] * 3)
    with pytest.raises(WrongSetting, match=r"its resolution of 0\.001 mm has 3\. Press its in/mm key, or"):
        await gauge.open()


@pytest.mark.parametrize(("gauge_of", "channel"), [(ID_H, 7), ((Mux10Gauge, "mux10", b"2\r"), 2)])
async def test_the_protocol_says_how_inches_look_and_the_cell_file_overrules_it(
    dialogue, links, settings, gauge_of, channel
):
    factory, protocol, request = gauge_of
    frame = b"GN07,+000.63956\r\n" if protocol == "mitutoyo-id-h" else b"02A+00.63956\r"
    dialogue.expect((request, frame))
    with pytest.raises(WrongSetting, match="gauge y: answers in inch"):
        await factory(settings(protocol, channel=channel), links).open()
    gauge = factory(settings(protocol, channel=channel, resolution_mm=1e-5), links)
    dialogue.expect((request, frame), *[(b"V\r", b"MUX-10F\r")] * (protocol == "mux10"))
    dialogue.expect(*[(request, frame)] * 3)
    await gauge.open()
    assert (await gauge.read()).value_mm == 0.63956


async def test_the_line_of_a_display_has_seven_bits_and_a_parity(dialogue, links, settings):
    gauge = HeidenhainGauge(settings("heidenhain-nd"), links)
    dialogue.expect((b"\x02", b"-      5.23  =A\r\n"))
    await gauge.open()
    assert [dialogue.settings[key] for key in ("baudrate", "bytesize", "parity", "stopbits")] == [
        9600,
        7,
        "E",
        2,
    ]


@pytest.mark.parametrize(("factory", "protocol", "question"), TWINS)
@given(value=st.floats(-6.0, 6.0), noise=st.binary(max_size=3), place=st.integers(0, 30))
def test_what_its_twin_answers_is_read_and_damage_is_rejected_or_a_number(
    factory, protocol, question, value, noise, place
):
    channel = 7 if factory in {IdHGauge, Mux10Gauge} else 1
    twin = instrument_class(protocol)({channel: Indicator(lambda: value)})
    settings = GaugeSettings(name="x", axis="x", protocol=protocol, channel=channel)
    gauge = factory(settings, SharedSerialPorts())
    frame = twin.answer(question.strip(b"\r\n\x02")).partition(gauge.terminator)[0] + gauge.terminator
    assert gauge._parse_value(frame).value == pytest.approx(value, abs=0.51e-3)
    with suppress(FrameRejected, MultiplexerBusy, HexacellError):
        assert abs(gauge._parse_value(frame[:place] + noise + frame[place + 1 :]).value) < 1e6
