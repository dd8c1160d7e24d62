"""Frames of Sylvac's opto-RS duplex protocol: values, errors and settings."""

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.errors import GaugeAtEnd, ZeroVoid
from drivers.gauges.protocol import DisplayedValue, FrameRejected
from drivers.gauges.sylvac import BATTERY, ERROR_FRAMES, IDENTIFICATION, PRESET, SylvacGauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError

parse_value = SylvacGauge(
    GaugeSettings(name="y", axis="y", protocol="sylvac"), SharedSerialPorts()
)._parse_value


@pytest.mark.parametrize(
    ("frame", "value"),
    [
        (b"+12.345\r", 12.345),
        (b"-0.001\r", -0.001),
        (b" 1.000\r", 1.0),
        (b"+12.345<\r", 12.345),
        (b"+12.345=\r", 12.345),
        (b"+12.345>\r", 12.345),
        (b"+001.2340\r", 1.234),
    ],
)
def test_a_value_is_read(frame, value):
    assert parse_value(frame) == DisplayedValue(
        value, len(re.findall(rb"\d", frame.split(b".")[1])), None, frame.decode().strip()
    )


@pytest.mark.parametrize(
    ("frame", "error"),
    list(zip(ERROR_FRAMES, (ZeroVoid, FrameRejected, FrameRejected, GaugeAtEnd), strict=True)),
)
def test_an_error_frame_is_an_error(frame, error):
    with pytest.raises(error):
        parse_value(frame)


@pytest.mark.parametrize(
    "frame",
    [
        *(b"12.345\r", b"+12.345", b"+12.345\r\r", b"+12345\r", b"+.345\r", b"+12.\r", b"+1 2.345\r"),
        *(b"++2.345\r", b"+12,345\r", b"+12.345==\r", b"+1\xb2.345\r", b"ERR4\r", b"\r", b""),
    ],
)
def test_malformed_frames_are_rejected(frame):
    with pytest.raises(FrameRejected):
        parse_value(frame)


@given(st.binary(max_size=12) | st.from_regex(rb"[+\- ]?[0-9. ]{1,9}[<=>]?\r", fullmatch=True))
@example(b"+1.2345\r")
def test_noise_is_a_value_only_if_it_is_one_to_the_last_byte(noise):
    try:
        shown = parse_value(noise)
    except (FrameRejected, DeviceError):
        return
    assert re.fullmatch(rb"[+\- ][0-9]+\.[0-9]+[<=>]?\r", noise)
    assert shown.value == float(noise.strip(b" <=>\r"))


def test_settings_are_read_with_and_without_their_name():
    assert BATTERY.parse(b"BAT1\r") == BATTERY.parse(b"1\r") == "1"
    assert PRESET.parse(b"PRE +1.500\r") == PRESET.parse(b"+1.500\r") == "+1.500"
    assert IDENTIFICATION.parse(b"ERR1\r") is None


@pytest.mark.parametrize("frame", [b"ERR0\r", b"ERR2\r", b"+1.234\r", b"\x8d\r"])
def test_an_identification_is_neither_fault_nor_value(frame):
    with pytest.raises(FrameRejected):
        IDENTIFICATION.parse(frame)
