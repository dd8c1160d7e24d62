"""What a frame of each protocol means: a value to its last byte, an error, or nothing."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import EmptyChannel, GaugeAtEnd, ZeroVoid
from drivers.gauges.cdi import CdiGauge
from drivers.gauges.mux10 import MultiplexerBusy, Mux10Gauge
from drivers.gauges.protocol import DisplayedValue, FrameRejected
from drivers.gauges.sylvac import ERROR_FRAMES, SylvacGauge
from drivers.gauges.uwave import UwaveGauge, channel_of
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError


def parser(gauge, protocol):
    settings = GaugeSettings(name="y", axis="y", protocol=protocol, channel=2)
    return gauge(settings, SharedSerialPorts())._parse_value


SYLVAC, CDI = parser(SylvacGauge, "sylvac"), parser(CdiGauge, "cdi")
MUX, UWAVE = parser(Mux10Gauge, "mux10"), parser(UwaveGauge, "uwave")

VALUES = [
    *((SYLVAC, b"+12.345%s\r" % sign, 12.345, 3, None) for sign in (b"", b"<", b"=", b">")),
    *((SYLVAC, b"-0.001\r", -0.001, 3, None), (SYLVAC, b" 1.000\r", 1.0, 3, None)),
    (SYLVAC, b"+001.2340\r", 1.234, 4, None),
    *((MUX, b"02A+0000.123\r", 0.123, 3, None), (MUX, b"02A-0012.340\r", -12.34, 3, None)),
    *((MUX, b"02A-001.2340\r", -1.234, 4, None), (MUX, b"02A+00.00484\r", 0.00484, 5, None)),
    *((CDI, b"+  2.1380, MM\r", 2.138, 4, "mm"), (CDI, b"- 12.3450, MM\r", -12.345, 4, "mm")),
    *((CDI, b"+00002.13, MM\r", 2.13, 2, "mm"), (CDI, b"+2.13    , MM\r", 2.13, 2, "mm")),
    (CDI, b"+ 0.08417, IN\r", 0.08417, 5, "inch"),
    *((UWAVE, b"DT10000+00000011.88M", 11.88, 2, "mm"), (UWAVE, b"DT10002-0000000.001M", -0.001, 3, "mm")),
    (UWAVE, b"DT10203+000.1234567I", 0.1234567, 7, "inch"),
]


@pytest.mark.parametrize(("parse", "frame", "value", "decimals", "unit"), VALUES)
def test_a_value_is_read_with_its_decimals_and_unit(parse, frame, value, decimals, unit):
    assert parse(frame) == DisplayedValue(value, decimals, unit, frame.decode().strip())


ERRORS = [
    *zip([SYLVAC] * 4, ERROR_FRAMES, (ZeroVoid, FrameRejected, FrameRejected, GaugeAtEnd), strict=True),
    *((MUX, b"911\r", EmptyChannel), (MUX, b"921\r", EmptyChannel)),
    *((MUX, b"918\r", MultiplexerBusy), (MUX, b"912\r", GaugeAtEnd)),
]


@pytest.mark.parametrize(("parse", "frame", "error"), ERRORS)
def test_an_error_is_read(parse, frame, error):
    with pytest.raises(error):
        parse(frame)


MALFORMED = {
    SYLVAC: (
        *(b"12.345\r", b"+12.345", b"+12.345\r\r", b"+12345\r", b"+.345\r", b"+12.\r", b"+1 2.345\r"),
        *(b"++2.345\r", b"+12,345\r", b"+12.345==\r", b"+1\xb2.345\r", b"ERR4\r", b"\r", b""),
    ),
    CDI: (
        *(b"   2.1380, MM\r", b"+ 2.1380, MM\r", b"+   2.1380, MM\r", b"+ 2 .1380, MM\r", b"NOT FOUND\r"),
        *(b"+  2.1380; MM\r", b"+  2.1380, mm\r", b"+  2.1380,MM\r", b"+  21380 , MM\r", b"+  2.1380, MM"),
        *(b"+  2.\xb1380, MM\r", b"+  2.13 0, MM\r", b""),
    ),
    MUX: (
        b"01A+0000.123\r",  # another channel
        *(b"931\r", b"02A 0000.123\r", b"02A+000.123\r", b"02A+00000.123\r", b"02A+00000123\r"),
        *(b"02A+00.0.123\r", b"02B+0000.123\r", b"02A+0000.123", b"02A+0000.1\xb23\r", b"91\r", b""),
    ),
}


TRANSMITTED = (
    *(
        b"DT10002-0000000.001",
        b"DT10002-0000000.001MM",
        b"DT10002-000000.001M",
        b"DT1002-00000000.001M",
        b"",
    ),
    *(b"DT10002 0000000.001M", b"DT10002-00000000001M", b"ST1000100009233899", b"TI1120000009241511"),
)


def test_malformed_values_are_rejected():
    for parse, frames in MALFORMED.items():
        for frame in frames:
            with pytest.raises(FrameRejected):
                parse(frame)
    assert {channel_of(frame) for frame in TRANSMITTED} == {None}


NOISE = [
    (SYLVAC, r"[+\- ]?[0-9. ]{1,9}[<=>]?\r", rb"[+\- ]\d+\.\d+[<=>]?\r", slice(None)),
    (MUX, r"0[0-9]A[+\- ][0-9. ]{6,9}\r", rb"02A(?=.{10}$)[+-]\d+\.\d+\r", slice(3, None)),
    (CDI, r"[+\- ][0-9. ]{7,9}, ?(IN|MM|NM|MN)\r", rb"(?=.{14}$)[+-] *\d+\.\d+ *, (IN|MM)\r", slice(9)),
    (CDI, r"[+-] *[0-9]{1,3}\.[0-9 ]{1,4}, MM\r", rb"(?=.{14}$)[+-] *\d+\.\d+ *, (IN|MM)\r", slice(9)),
]


@pytest.mark.parametrize(("parse", "alike", "whole", "number"), NOISE)
@given(data=st.data())
def test_noise_is_a_value_only_if_it_is_one_to_the_last_byte(parse, alike, whole, number, data):
    noise = data.draw(st.binary(max_size=16) | st.from_regex(alike.encode(), fullmatch=True))
    try:
        shown = parse(noise)
    except (FrameRejected, DeviceError, MultiplexerBusy):
        return
    assert re.fullmatch(whole, noise, re.DOTALL)
    assert shown.value == float(noise[number].strip(b"<=>\r").replace(b" ", b""))
