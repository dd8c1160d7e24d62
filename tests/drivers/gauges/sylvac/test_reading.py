"""Sylvac's opto-RS duplex: frames, opening and reading."""

import re

import pytest

from drivers.errors import GaugeUnsteady, WrongAnswer, WrongSetting
from drivers.gauges.protocol import FrameRejected
from drivers.gauges.serial_gauge import MAX_READINGS
from drivers.gauges.sylvac import BATTERY, IDENTIFICATION, PRESET, SylvacGauge
from drivers.interfaces import DeviceIdentity, Gauge, GaugeReading
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError
from tests.drivers.gauges.sylvac.conftest import OPENING, opening

parse_value = SylvacGauge(
    GaugeSettings(name="y", axis="y", protocol="sylvac"), SharedSerialPorts()
)._parse_value


def test_settings_are_read_with_and_without_their_name():
    assert BATTERY.parse(b"BAT1\r") == BATTERY.parse(b"1\r") == "1"
    assert PRESET.parse(b"PRE +1.500\r") == PRESET.parse(b"+1.500\r") == "+1.500"
    assert IDENTIFICATION.parse(b"ERR1\r") is None


@pytest.mark.parametrize("frame", [b"ERR0\r", b"ERR2\r", b"+1.234\r", b"\x8d\r"])
def test_an_identification_is_neither_fault_nor_value(frame):
    with pytest.raises(FrameRejected):
        IDENTIFICATION.parse(frame)


async def test_opening_identifies_the_gauge_and_reading_gives_its_value(dialogue, gauge):
    dialogue.expect(*OPENING, (b"?\r", b"+1.234\r"), (b"?\r", b"+1.236\r"))
    assert await gauge.open() == DeviceIdentity("y", "sylvac", "SY276")
    assert await gauge.read() == GaugeReading(1.236, "+1.236")
    interface: Gauge = gauge
    assert interface.name == "y"


async def test_the_serial_line_has_the_defaults_of_the_protocol(dialogue, opened):
    assert dialogue.settings == {
        "baudrate": 4800,
        "bytesize": 7,
        "parity": "E",
        "stopbits": 2,
        "exclusive": True,
    }
    assert (dialogue.dtr, dialogue.rts) == (True, False)


async def test_echoed_requests_are_not_answers(dialogue, gauge):
    echoed = [(question, question, answer) for question, answer in OPENING]
    dialogue.expect(*echoed, (b"?\r", b"?\r+1.234\r"), (b"?\r", b"?\r\n+1.234\r\n"))
    await gauge.open()
    assert (await gauge.read()).value_mm == 1.234


async def test_an_instrument_that_reports_only_its_unit_is_accepted(dialogue, gauge):
    unknown = [(question, b"ERR1\r") for question, _ in OPENING[1:]]
    dialogue.expect(OPENING[0], *sorted(2 * unknown, key=unknown.index), OPENING[0], *unknown)
    assert (await gauge.open()).description == "Sylvac opto-RS indicator"
    await gauge.check()


async def test_an_instrument_that_does_not_report_its_unit_is_refused(dialogue, gauge):
    dialogue.expect(*[(b"UNI?\r", b"ERR1\r")] * 2)
    with pytest.raises(DeviceError, match="gauge y: does not report its unit"):
        await gauge.open()


async def test_a_setting_is_absent_only_if_that_is_said_twice(dialogue, gauge):
    asked = opening(STO=b"STO1\r")
    dialogue.expect(*asked[:4], (b"STO?\r", b"ERR1\r"), *asked[4:], *2 * asked)
    with pytest.raises(WrongSetting, match="on hold"):
        await gauge.open()


async def test_a_wrong_digit_or_frame_is_not_accepted(dialogue, opened) -> None:
    values = (b"+1.234\r", b"+5.234\r", b"+1.234\r", b"+1.235\r")
    dialogue.expect(*((b"?\r", value) for value in values))
    assert (await opened.read()).value_mm == 1.235
    answers = (b"+1.2\x134\r", b"+1.234\r", b"1.234\r", b"+1.234\r")
    dialogue.expect(*((b"?\r", answer) for answer in answers))
    assert (await opened.read()).value_mm == 1.234


async def test_readings_that_never_agree_are_an_error_of_their_own(dialogue, opened):
    dialogue.expect(*((b"?\r", b"+%d.000\r" % number) for number in range(MAX_READINGS)))
    with pytest.raises(GaugeUnsteady, match=r"\+0\.000, \+1\.000"):
        await opened.read()


async def test_read_once_does_not_repeat_a_garbled_answer(dialogue, opened):
    dialogue.expect((b"?\r", b"+1.2x4\r"), (b"?\r", b"+1.234\r"))
    with pytest.raises(WrongAnswer, match="gauge y"):
        await opened.read_once()
    assert (await opened.read_once()).value_mm == 1.234


GARBLED, ONE_DIGIT_LOST = b"+1.\xb234\r", b"+1.24\r"


@pytest.mark.parametrize(
    ("answers", "error", "words"),
    [
        ((GARBLED, GARBLED, ONE_DIGIT_LOST), WrongAnswer, re.escape(f"answers {GARBLED!r}")),
        ((ONE_DIGIT_LOST, GARBLED, ONE_DIGIT_LOST), WrongSetting, "shows 2 decimals"),
    ],
)
async def test_a_digit_lost_once_is_damage_and_no_setting(dialogue, opened, answers, error, words):
    dialogue.expect(*[(b"?\r", b"+1.234\r")] * 2)
    await opened.read()
    dialogue.expect(*((b"?\r", answer) for answer in answers))
    with pytest.raises(error, match=words):
        await opened.read()
