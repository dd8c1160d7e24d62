"""A Sylvac gauge is identified and read; settings and answers that falsify readings are told."""

import re

import pytest

from drivers.errors import GaugeAtEnd, GaugeSilent, GaugeUnsteady, WrongAnswer, WrongSetting, ZeroVoid
from drivers.gauges.protocol import FrameRejected
from drivers.gauges.serial_gauge import MAX_READINGS
from drivers.gauges.sylvac import BATTERY, IDENTIFICATION, PRESET, SylvacGauge
from drivers.interfaces import DeviceIdentity, Gauge, GaugeReading
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError, ExitCode
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


async def test_a_silent_gauge_is_named_with_what_to_do(dialogue, gauge):
    dialogue.expect((b"UNI?\r",))
    with pytest.raises(
        GaugeSilent, match=r"y: does not answer within 0.05 s on port wire\. Switch"
    ) as caught:
        await gauge.open()
    assert caught.value.exit_code is ExitCode.HARDWARE
    assert not dialogue.is_open


async def test_requests_with_wrong_parity_are_recognised(dialogue, opened):
    dialogue.expect(*[(b"?\r", b"ERR2\r")] * 3)
    with pytest.raises(WrongAnswer, match=r"ERR2.*Check parity settings"):
        await opened.read()


async def test_a_plunger_at_its_end_is_an_error_of_its_own(dialogue, opened):
    dialogue.expect((b"?\r", b"ERR3\r"), (b"?\r", b"+6.000\r"), (b"?\r", b"+6.000\r"))
    with pytest.raises(GaugeAtEnd, match="gauge y: plunger at its end"):
        await opened.read()
    assert (await opened.read()).value_mm == 6.0


async def test_overspeed_voids_the_zero_until_it_is_opened_again(dialogue, opened):
    dialogue.expect((b"?\r", b"ERR0\r"))
    for _ in range(2):
        with pytest.raises(ZeroVoid, match="ERR0"):
            await opened.read()
    with pytest.raises(ZeroVoid):
        await opened.check()
    dialogue.expect(*OPENING, (b"?\r", b"+1.000\r"), (b"?\r", b"+1.000\r"))
    await opened.open()
    assert (await opened.read()).value_mm == 1.0


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"UNI": b"IN\r"}, "gauge y: answers in inch. Press its in/mm key"),
        ({"STO": b"STO1\r"}, "is on hold"),
        ({"MOD": b"MIN\r"}, "is in mode MIN"),
        ({"MOD": b"MAX\r"}, "is in mode MAX"),
        ({"MOD": b"TOL1\r"}, "is in mode TOL1"),
        ({"BAT": b"BAT0\r"}, "has a low battery"),
    ],
)
async def test_settings_that_falsify_readings_are_refused_at_opening_and_by_the_check(
    dialogue, gauge, answers, words
):
    dialogue.expect(*opening(**answers) * 3)
    with pytest.raises(WrongSetting, match=words):
        await gauge.open()
    dialogue.expect(*OPENING, *opening(**answers) * 3)
    await gauge.open()
    with pytest.raises(WrongSetting, match=words):
        await gauge.check()


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"CHA": b"CHA-\r"}, "reversed False -> True"),
        ({"PRE": b"PRE +5.000\r"}, r"preset \+0.000 -> \+5.000"),
        ({"ID?": b"SY233\r"}, "identification SY276 -> SY233"),
        ({"MOD": b"REF1\r"}, "mode NOR -> REF1"),
    ],
)
async def test_a_setting_changed_during_a_set_voids_the_zero(dialogue, opened, answers, words):
    dialogue.expect(*opening(**answers) * 3)
    with pytest.raises(ZeroVoid, match=words):
        await opened.check()
    with pytest.raises(ZeroVoid):
        await opened.read()


@pytest.mark.parametrize("answers", [{"PRE": b"PRE +0.008\r"}, {"STO": b"STO1\r"}, {"BAT": b"BAT0\r"}])
async def test_one_damaged_answer_is_neither_a_change_nor_a_wrong_setting(dialogue, opened, answers):
    dialogue.expect(*opening(**answers), *OPENING)
    await opened.check()


async def test_a_gauge_that_sends_everything_twice_is_used(dialogue, gauge):
    dialogue.expect(*((question, answer, answer) for question, answer in OPENING))
    dialogue.expect(*[(b"?\r", b"+1.000\r", b"+1.000\r")] * 2)
    await gauge.open()
    assert (await gauge.read()).value_mm == 1.0
    dialogue.expect(*((question, answer, answer) for question, answer in OPENING))
    await gauge.check()


async def test_an_identification_that_comes_once_more_is_not_switching_on(dialogue, opened):
    later = [(b"MOD?\r", b"SY276\r"), (b"MOD?\r", b"NOR\r")]
    dialogue.expect(*OPENING[:3], *later, *OPENING[4:])
    await opened.check()
    dialogue.unasked(b"SY276\r")
    dialogue.expect((b"?\r", b"+1.000\r"))
    with pytest.raises(ZeroVoid, match="switched on again"):
        await opened.read()


@pytest.mark.parametrize(
    ("before", "answer", "shown"),
    [(b"SY276.1\r", b"+0.000\r", r"SY276\.1"), (b"", b"TE233.1.2\r", r"TE233")],
)
async def test_a_power_up_message_before_or_as_an_answer_voids_the_zero(
    dialogue, opened, before, answer, shown
):
    dialogue.unasked(before)
    dialogue.expect((b"?\r", answer))
    with pytest.raises(ZeroVoid, match=f"switched on again.*{shown}"):
        await opened.read()


async def test_a_power_up_message_among_the_answers_of_the_check_voids_the_zero(dialogue, opened):
    dialogue.expect(*OPENING[:2], (b"ID?\r", b"SY276.1\rSY276\r"), (b"MOD?\r", b"NOR\r"))
    with pytest.raises(ZeroVoid, match="switched on again"):
        await opened.check()


async def test_requests_are_repeated_if_opening_switches_the_gauge_on(dialogue, gauge):
    dialogue.expect((b"UNI?\r", b"SY276.1\rMM\r"), *OPENING, *[(b"?\r", b"+1.000\r")] * 2)
    await gauge.open()
    assert (await gauge.read()).value_mm == 1.0
