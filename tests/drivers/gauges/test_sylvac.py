"""Sylvac's opto-RS duplex protocol: its frames, its dialogue, and what goes wrong with it."""

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.gauges.errors import (
    FrameRejected,
    GaugeAtEnd,
    GaugeSilent,
    GaugeUnsteady,
    WrongAnswer,
    WrongMode,
    WrongUnit,
    ZeroVoid,
)
from drivers.gauges.serial_gauge import READINGS
from drivers.gauges.shown import Shown
from drivers.gauges.sylvac import BATTERY, IDENTIFICATION, PRESET, Fault, SylvacGauge, parse_value
from drivers.ports import DeviceIdentity, Gauge, GaugeReading
from drivers.simulated.gauges.sylvac import format_value
from hexacell.errors import DeviceError, ExitCode, FileError

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


# Frames


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
    assert parse_value(frame) == Shown(
        value, len(re.findall(rb"\d", frame.split(b".")[1])), None, frame.decode().strip()
    )


@pytest.mark.parametrize("fault", Fault)
def test_a_fault_is_read(fault):
    assert parse_value(fault.value) is fault


@pytest.mark.parametrize(
    "frame",
    [
        b"12.345\r",
        b"+12.345",
        b"+12.345\r\r",
        b"+12.345\r\n",
        b"+12345\r",
        b"+.345\r",
        b"+12.\r",
        b"+1 2.345\r",
        b"++2.345\r",
        b"+12,345\r",
        b"+12.345==\r",
        b"+1\xb2.345\r",
        b"ERR4\r",
        b"ERR\r",
        b"\r",
        b"",
    ],
)
def test_anything_else_is_rejected(frame):
    with pytest.raises(FrameRejected):
        parse_value(frame)


@given(st.floats(-999, 999), st.booleans())
def test_what_the_simulated_device_writes_is_read(value, inch):
    shown = parse_value(format_value(value, inch=inch))
    assert isinstance(shown, Shown)
    assert shown.value == pytest.approx(value, abs=0.51e-5 if inch else 0.51e-3)
    assert (shown.apparent_unit == "inch") is inch


@given(st.binary(max_size=12) | st.from_regex(rb"[+\- ]?[0-9. ]{1,9}[<=>]?\r", fullmatch=True))
@example(b"+1.2345\r")
def test_noise_is_a_value_only_if_it_is_one_to_the_last_byte(noise):
    try:
        shown = parse_value(noise)
    except FrameRejected:
        return
    if isinstance(shown, Shown):
        assert re.fullmatch(rb"[+\- ][0-9]+\.[0-9]+[<=>]?\r", noise)
        assert shown.value == float(noise.strip(b" <=>\r"))


@given(st.floats(-99, 99), st.integers(0, 6), st.integers(0, 6))
def test_no_part_of_a_value_is_a_value(value, front, back):
    frame = format_value(value, inch=False)
    part = frame[front : len(frame) - back]
    if part != frame:
        with pytest.raises(FrameRejected):
            parse_value(part)


def test_settings_are_read_with_and_without_their_name():
    assert BATTERY.parse(b"BAT1\r") == BATTERY.parse(b"1\r") == "1"
    assert PRESET.parse(b"PRE +1.500\r") == PRESET.parse(b"+1.500\r") == "+1.500"
    assert IDENTIFICATION.parse(b"ERR1\r") is None


@given(st.binary(max_size=10))
def test_noise_is_no_setting(noise):
    with pytest.raises(FrameRejected):
        BATTERY.parse(noise.replace(b"0", b"2").replace(b"1", b"2"))


@pytest.mark.parametrize("frame", [b"ERR0\r", b"ERR2\r", b"+1.234\r", b"\x8d\r"])
def test_an_identification_is_neither_fault_nor_value(frame):
    with pytest.raises(FrameRejected):
        IDENTIFICATION.parse(frame)


# Opening and reading


async def test_it_opens_and_reads(dialogue, gauge):
    dialogue.expect(*OPENING, (b"?\r", b"+1.234\r"), (b"?\r", b"+1.236\r"))
    assert await gauge.open() == DeviceIdentity("y", "sylvac", "SY276")
    assert await gauge.read() == GaugeReading(1.236, "+1.236")
    interface: Gauge = gauge
    assert interface.name == "y"


async def test_its_line_has_the_protocols_defaults(dialogue, opened):
    assert dialogue.settings == {
        "baudrate": 4800,
        "bytesize": 7,
        "parity": "E",
        "stopbits": 2,
        "exclusive": True,
    }
    assert (dialogue.dtr, dialogue.rts) == (True, False)


async def test_the_cell_file_overrides_the_defaults(dialogue, links, settings):
    dialogue.expect(*OPENING)
    serial = {"baudrate": 9600, "xonxoff": True, "dtr": False}
    gauge = SylvacGauge(settings("sylvac", serial=serial), links)
    await gauge.open()
    assert dialogue.settings["baudrate"] == 9600
    assert dialogue.settings["xonxoff"] is True
    assert dialogue.settings["parity"] == "E"
    assert dialogue.dtr is False
    await gauge.close()


async def test_commands_that_are_echoed_are_no_answers(dialogue, gauge):
    echoed = [(question, question, answer) for question, answer in OPENING]
    dialogue.expect(*echoed, (b"?\r", b"?\r+1.234\r"), (b"?\r", b"?\r\n+1.234\r\n"))
    await gauge.open()
    assert (await gauge.read()).value_mm == 1.234


async def test_an_instrument_that_knows_only_its_unit_will_do(dialogue, gauge):
    unknown = [(question, b"ERR1\r") for question, _ in OPENING[1:]]
    dialogue.expect(OPENING[0], *unknown, OPENING[0], *unknown)
    assert (await gauge.open()).description == "Sylvac opto-RS indicator"
    await gauge.check()


async def test_an_instrument_that_does_not_tell_its_unit_is_refused(dialogue, gauge):
    dialogue.expect((b"UNI?\r", b"ERR1\r"))
    with pytest.raises(DeviceError, match="gauge y: does not tell its unit"):
        await gauge.open()


async def test_a_flipped_digit_does_not_get_through(dialogue, opened):
    values = (b"+1.234\r", b"+5.234\r", b"+1.234\r", b"+1.235\r")
    dialogue.expect(*((b"?\r", value) for value in values))
    assert (await opened.read()).value_mm == 1.235


async def test_readings_that_never_agree_are_an_error_of_their_own(dialogue, opened):
    dialogue.expect(*((b"?\r", b"+%d.000\r" % number) for number in range(READINGS)))
    with pytest.raises(GaugeUnsteady, match=r"\+0\.000, \+1\.000"):
        await opened.read()


async def test_a_frame_that_does_not_match_is_asked_again(dialogue, opened):
    answers = (b"+1.2\x134\r", b"+1.234\r", b"1.234\r", b"+1.234\r")
    dialogue.expect(*((b"?\r", answer) for answer in answers))
    assert (await opened.read()).value_mm == 1.234


async def test_a_frame_cut_short_is_asked_again(dialogue, opened):
    dialogue.expect((b"?\r", b"+1.23"), (b"?\r", b"+1.234\r"), (b"?\r", b"+1.234\r"))
    assert (await opened.read()).value_mm == 1.234


# What goes wrong


async def test_a_silent_gauge_is_named_with_what_to_do(dialogue, gauge):
    dialogue.expect((b"UNI?\r",))
    with pytest.raises(GaugeSilent) as caught:
        await gauge.open()
    assert str(caught.value) == (
        "gauge y: does not answer within 0.05 s on port wire. "
        "Switch it on, check its cable, and port in the cell file"
    )
    assert caught.value.exit_code is ExitCode.HARDWARE
    assert not dialogue.is_open


async def test_an_echo_alone_is_silence(dialogue, gauge):
    dialogue.expect((b"UNI?\r", b"UNI?\r"))
    with pytest.raises(GaugeSilent, match="only our own question comes back"):
        await gauge.open()


async def test_another_protocol_is_quoted_beside_what_was_expected(dialogue, gauge):
    dialogue.expect(*[(b"UNI?\r", b"NOT FOUND\r\n")] * 3)
    with pytest.raises(WrongAnswer) as caught:
        await gauge.open()
    assert str(caught.value) == (
        "gauge y: answers b'NOT FOUND\\r' where protocol sylvac has answers like '+12.345\\r'. "
        "Correct protocol or port in the cell file"
    ).replace("'+12.345\r'", "'+12.345\\r'")


async def test_even_parity_read_as_eight_bits_is_recognised(dialogue, gauge):
    with_parity = bytes(byte | (byte.bit_count() % 2) << 7 for byte in b"MM\r")
    dialogue.expect(*[(b"UNI?\r", with_parity)] * 3)
    with pytest.raises(WrongAnswer, match=r"Check parity settings.*4800 baud 7E2"):
        await gauge.open()


async def test_questions_with_wrong_parity_are_recognised(dialogue, opened):
    dialogue.expect(*[(b"?\r", b"ERR2\r")] * 3)
    with pytest.raises(WrongAnswer, match=r"ERR2.*Check parity settings"):
        await opened.read()


async def test_a_plunger_at_its_end_is_an_error_of_its_own(dialogue, opened):
    dialogue.expect((b"?\r", b"ERR3\r"), (b"?\r", b"+6.000\r"), (b"?\r", b"+6.000\r"))
    with pytest.raises(GaugeAtEnd, match="gauge y: plunger at its end"):
        await opened.read()
    assert (await opened.read()).value_mm == 6.0


async def test_a_plunger_at_its_end_in_the_second_reading_counts_too(dialogue, opened):
    dialogue.expect((b"?\r", b"+6.240\r"), (b"?\r", b"ERR3\r"))
    with pytest.raises(GaugeAtEnd):
        await opened.read()


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


async def test_an_inch_gauge_is_refused(dialogue, gauge):
    dialogue.expect(*opening(UNI=b"IN\r"))
    with pytest.raises(WrongUnit) as caught:
        await gauge.open()
    assert str(caught.value) == "gauge y: answers in inch. Press its in/mm key"


async def test_inch_pressed_during_a_set_is_found_in_a_reading(dialogue, opened):
    dialogue.expect((b"?\r", b"+0.04858\r"))
    with pytest.raises(WrongUnit):
        await opened.read()


async def test_inch_pressed_during_a_set_is_found_by_the_check(dialogue, opened):
    dialogue.expect(*opening(UNI=b"IN\r"))
    with pytest.raises(WrongUnit):
        await opened.check()


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"STO": b"STO1\r"}, "is on hold"),
        ({"MOD": b"MIN\r"}, "is in mode MIN"),
        ({"MOD": b"MAX\r"}, "is in mode MAX"),
        ({"MOD": b"TOL1\r"}, "is in mode TOL1"),
        ({"BAT": b"BAT0\r"}, "has a low battery"),
    ],
)
async def test_what_falsifies_readings_is_refused_at_opening_and_by_the_check(
    dialogue, gauge, answers, words
):
    dialogue.expect(*opening(**answers))
    with pytest.raises(WrongMode, match=words):
        await gauge.open()
    dialogue.expect(*OPENING, *opening(**answers))
    await gauge.open()
    with pytest.raises(WrongMode, match=words):
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
async def test_what_changed_during_a_set_voids_its_zero(dialogue, opened, answers, words):
    dialogue.expect(*opening(**answers))
    with pytest.raises(ZeroVoid, match=words):
        await opened.check()
    with pytest.raises(ZeroVoid):
        await opened.read()


async def test_an_unchanged_gauge_passes_the_check(dialogue, opened):
    dialogue.expect(*OPENING)
    await opened.check()


async def test_a_power_up_banner_before_a_question_voids_the_zero(dialogue, opened):
    dialogue.unasked(b"SY276.1\r")
    dialogue.expect((b"?\r", b"+0.000\r"))
    with pytest.raises(ZeroVoid, match=r"switched on again.*SY276\.1"):
        await opened.read()


async def test_a_power_up_banner_instead_of_an_answer_voids_the_zero(dialogue, opened):
    dialogue.expect((b"?\r", b"TE233.1.2\r"))
    with pytest.raises(ZeroVoid, match="switched on again"):
        await opened.read()


async def test_a_power_up_banner_among_the_checks_answers_voids_the_zero(dialogue, opened):
    dialogue.expect(*OPENING[:2], (b"ID?\r", b"SY276.1\rSY276\r"), (b"MOD?\r", b"NOR\r"))
    with pytest.raises(ZeroVoid, match="switched on again"):
        await opened.check()


async def test_a_gauge_that_wakes_up_when_it_is_opened_is_asked_again(dialogue, gauge):
    dialogue.expect((b"UNI?\r", b"SY276.1\rMM\r"), *OPENING, *[(b"?\r", b"+1.000\r")] * 2)
    await gauge.open()
    assert (await gauge.read()).value_mm == 1.0


async def test_a_banner_that_came_before_opening_is_old_news(dialogue, gauge, monkeypatch):
    opening_port = dialogue.open

    def open_with_banner():
        opening_port()
        dialogue.unasked(b"SY276.1\r")

    monkeypatch.setattr(dialogue, "open", open_with_banner)
    dialogue.expect(OPENING[0], *OPENING)
    await gauge.open()


async def test_a_lost_port_is_told_and_voids_what_others_zeroed(dialogue, opened):
    dialogue.broken = OSError(5, "Input/output error")
    with pytest.raises(DeviceError, match="gauge y: port wire was lost"):
        await opened.read()
    dialogue.broken = None
    with pytest.raises(DeviceError, match="was lost"):
        await opened.read()
    dialogue.expect(*OPENING, (b"?\r", b"+1.000\r"), (b"?\r", b"+1.000\r"))
    await opened.open()
    assert (await opened.read()).value_mm == 1.0


async def test_it_must_be_opened_before_use_and_closes_twice(dialogue, gauge):
    for call in (gauge.read, gauge.check):
        with pytest.raises(DeviceError, match="gauge y: is not open"):
            await call()
    dialogue.expect(*OPENING)
    await gauge.open()
    await gauge.close()
    await gauge.close()
    assert not dialogue.is_open
    with pytest.raises(DeviceError, match="is not open"):
        await gauge.read()


async def test_a_gauge_without_a_port_is_an_error_of_the_cell_file(links, settings):
    with pytest.raises(FileError, match="gauge y: has no port"):
        await SylvacGauge(settings("sylvac", port=None), links).open()


async def test_two_gauges_cannot_have_one_port(dialogue, opened, links, settings):
    with pytest.raises(FileError, match="gauge z: port wire already belongs to gauge y"):
        await SylvacGauge(settings("sylvac", name="z"), links).open()


# Glancing


async def test_a_glance_is_one_question(dialogue, opened):
    dialogue.expect((b"?\r", b"+1.234\r"))
    assert await opened.glance() == GaugeReading(1.234, "+1.234")


async def test_glances_need_not_agree(dialogue, opened):
    dialogue.expect((b"?\r", b"+1.234\r"), (b"?\r", b"+4.321\r"))
    assert [(await opened.glance()).value_mm for _ in range(2)] == [1.234, 4.321]


async def test_a_garbled_glance_is_not_repeated(dialogue, opened):
    dialogue.expect((b"?\r", b"+1.2x4\r"), (b"?\r", b"+1.234\r"))
    with pytest.raises(WrongAnswer, match="gauge y"):
        await opened.glance()
    assert (await opened.glance()).value_mm == 1.234


async def test_a_glance_at_the_end_of_its_travel(dialogue, opened):
    dialogue.expect((b"?\r", b"ERR3\r"))
    with pytest.raises(GaugeAtEnd):
        await opened.glance()


async def test_a_glance_that_is_not_answered(dialogue, opened):
    dialogue.expect((b"?\r", b""))
    with pytest.raises(GaugeSilent):
        await opened.glance()


async def test_nobody_glances_at_a_gauge_that_is_closed(gauge):
    with pytest.raises(DeviceError, match="is not open"):
        await gauge.glance()
