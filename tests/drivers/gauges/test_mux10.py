"""MUX-10 frames: several gauges behind one line."""

import pytest

from drivers.errors import WrongAnswer, WrongSetting, ZeroVoid
from drivers.gauges import mux10
from drivers.gauges.mux10 import Mux10Gauge, parse_identification
from drivers.gauges.protocol import FrameRejected
from drivers.interfaces import DeviceIdentity, GaugeReading
from hexacell.errors import DeviceError

VALUE = b"02A+0000.123\r"
OPENING = ((b"2\r", VALUE), (b"V\r", b"MUX-10F 1.0\r"))


@pytest.fixture
async def gauge(links, settings):
    return Mux10Gauge(settings("mux10", channel=2), links)


@pytest.fixture
async def opened(dialogue, gauge):
    dialogue.expect(*OPENING)
    await gauge.open()
    return gauge


# Frames


@pytest.mark.parametrize("frame", [b"911\r", b"01A+0000.123\r", b"\x80MUX\r", b"\r"])
def test_an_error_or_a_value_is_no_description(frame):
    with pytest.raises(FrameRejected):
        parse_identification(frame)


# Dialogues


async def test_opening_identifies_the_gauge_and_reading_gives_its_value(dialogue, gauge):
    dialogue.expect(*OPENING, (b"2\r", VALUE), (b"2\r", b"02A+0000.124\r"))
    assert await gauge.open() == DeviceIdentity("y", "mux10", "MUX-10F 1.0")
    assert await gauge.read() == GaugeReading(0.124, "02A+0000.124")
    assert dialogue.settings["baudrate"] == 9600
    assert (dialogue.settings["bytesize"], dialogue.settings["parity"]) == (8, "N")


async def test_a_multiplexer_without_identification_is_accepted(dialogue, gauge):
    dialogue.expect((b"2\r", VALUE), (b"V\r",), (b"2\r", VALUE))
    assert (await gauge.open()).description == "Mitutoyo MUX-10 channel"
    await gauge.check()


async def test_a_busy_multiplexer_is_asked_again_unless_it_stays_busy(dialogue, opened, monkeypatch):
    monkeypatch.setattr(Mux10Gauge, "busy_pause_s", 0.0)
    dialogue.expect(
        (b"2\r", b"918\r"), (b"2\r", b"918\r"), (b"2\r", VALUE), (b"2\r", b"918\r"), (b"2\r", VALUE)
    )
    assert (await opened.read()).value_mm == 0.123
    dialogue.expect(*[(b"2\r", b"918\r")] * mux10.BUSY_TRIES)
    with pytest.raises(DeviceError, match=r"gauge y: its multiplexer stays busy \(918\)"):
        await opened.read()


async def test_a_plunger_at_its_end_does_not_prevent_opening(dialogue, gauge):
    dialogue.expect((b"2\r", b"912\r"), OPENING[1], (b"2\r", VALUE), (b"2\r", VALUE), (b"2\r", VALUE))
    await gauge.open()
    assert (await gauge.read()).value_mm == 0.123
    await gauge.check()


async def test_a_value_sent_by_the_data_button_of_another_channel_is_discarded(dialogue, opened):
    dialogue.expect((b"2\r", b"01A+0009.999\r" + VALUE), (b"2\r", VALUE), (b"2\r", VALUE))
    dialogue.unasked(b"01A+0008.888\r")
    assert (await opened.read()).value_mm == 0.123


@pytest.mark.parametrize("call", ["read", "check", "read_once"])
async def test_other_decimals_are_another_unit(dialogue, opened, call):
    """A display in inches may have three, four or five decimals, and nothing in the answer tells which."""
    dialogue.expect(*[(b"2\r", b"02A+000.0123\r")] * (1 if call == "read_once" else 3))
    with pytest.raises(WrongSetting, match=r"shows 4 decimals .* where it showed 3 when"):
        await getattr(opened, call)()


async def test_decimals_of_the_first_opening_hold_after_it_was_opened_again(dialogue, opened):
    await opened.close()
    dialogue.expect(*[(b"2\r", b"02A+000.0123\r")] * 3)
    with pytest.raises(WrongSetting, match="where it showed 3 when it was first opened"):
        await opened.open()
    dialogue.expect((b"2\r", VALUE), OPENING[1])
    await opened.open()


async def test_one_answer_with_a_misplaced_point_is_asked_for_again(dialogue, opened):
    dialogue.expect((b"2\r", b"02A+000.0123\r"), (b"2\r", VALUE), (b"2\r", VALUE))
    assert (await opened.read()).value_mm == 0.123


@pytest.mark.parametrize(("resolution_mm", "decimals"), [(0.001, 3), (0.0005, 4), (0.01, 2), (0.005, 3)])
async def test_a_gauge_of_another_resolution_than_stated_is_refused(
    dialogue, links, settings, resolution_mm, decimals
):
    shown = {number: b"02A+%08.*f\r" % (number, 1.0) for number in (2, 3, 4)}
    gauge = Mux10Gauge(settings("mux10", channel=2, resolution_mm=resolution_mm), links)
    for number, value in shown.items():
        if number == decimals:
            dialogue.expect((b"2\r", value), OPENING[1], (b"2\r", value))
            await gauge.open()
            await gauge.close()
        else:
            dialogue.expect(*[(b"2\r", value)] * 3)
            with pytest.raises(WrongSetting, match=f"resolution of {resolution_mm:g} mm has {decimals}"):
                await gauge.open()


async def test_values_farther_apart_than_the_travel_are_damaged(dialogue, opened):
    dialogue.expect(*[(b"2\r", VALUE)] * 2)
    assert (await opened.read()).value_mm == 0.123
    dialogue.expect((b"2\r", b"02A+0040.123\r"), *[(b"2\r", VALUE)] * 2)
    assert (await opened.read()).value_mm == 0.123
    dialogue.expect(*[(b"2\r", b"02A+0040.123\r")] * 3)
    with pytest.raises(WrongAnswer, match=r"shows 02A\+0040.123, and values 40.000 mm apart do not fit"):
        await opened.read()


async def test_a_value_that_was_shown_once_makes_no_other_impossible(dialogue, opened):
    """Damage within the travel: the right values are at its other end."""
    low, high, right = b"02A-0011.000\r", b"02A+0012.000\r", b"02A-0001.500\r"
    dialogue.expect(*((b"2\r", value) for value in (VALUE, high, VALUE, VALUE)))
    assert (await opened.read()).value_mm == 0.123
    dialogue.expect(*((b"2\r", value) for value in (low, low, right, right)))
    assert (await opened.read()).value_mm == -11.0
    assert (await opened.read()).value_mm == -1.5


@pytest.mark.parametrize(("middle_mm", "is_refused"), [(0.0, True), (None, False)])
async def test_a_gauge_that_may_be_zeroed_at_either_end_shows_twice_its_travel(
    dialogue, links, settings, middle_mm, is_refused
):
    gauge = Mux10Gauge(settings("mux10", channel=2, travel_mm=10.0, middle_mm=middle_mm), links)
    ends = [b"02A-0009.000\r"] * 2 + [b"02A+0009.000\r"] * (3 if is_refused else 2)
    dialogue.expect(*OPENING, *((b"2\r", value) for value in ends))
    await gauge.open()
    assert (await gauge.read()).value_mm == -9.0
    if is_refused:
        with pytest.raises(WrongAnswer, match="do not fit into its travel of 10 mm"):
            await gauge.read()
    else:
        assert (await gauge.read()).value_mm == 9.0


@pytest.mark.parametrize("damaged", [0, 1, 2])
async def test_damage_below_the_agreement_is_outvoted_by_a_third_reading(
    dialogue, links, settings, damaged
):
    """One bit of the hundredths: 0.04 mm, where two readings may differ by 0.05 mm."""
    gauge = Mux10Gauge(settings("mux10", channel=2, agreement_mm=0.05), links)
    values = [b"02A+0004.102\r", b"02A+0004.102\r", b"02A+0004.102\r"]
    values[damaged] = b"02A+0004.142\r"
    needed = values[:2] if damaged == 2 else values
    dialogue.expect(*OPENING, *((b"2\r", value) for value in needed))
    await gauge.open()
    assert (await gauge.read()).value_mm == 4.102


async def test_a_line_lost_and_opened_again_voids_the_zero_of_every_gauge_on_it(dialogue, links, settings):
    one, two = (Mux10Gauge(settings("mux10", f"g{each}", channel=each), links) for each in (1, 2))
    first, second = (b"1\r", b"01A+0001.000\r"), (b"2\r", b"02A+0001.000\r")
    dialogue.expect(first, OPENING[1], second, OPENING[1])
    await one.open()
    await two.open()
    dialogue.broken = OSError(5, "Input/output error")
    with pytest.raises(DeviceError, match="gauges g1, g2: port wire was lost"):
        await one.read()
    dialogue.broken = None
    dialogue.expect(first, OPENING[1])
    await one.open()
    with pytest.raises(ZeroVoid, match="gauge g2: lost its port meanwhile"):
        await two.read()
    dialogue.expect(second, OPENING[1], second, second)
    await two.open()
    assert (await two.read()).value_mm == 1.0


# Glancing


async def test_read_once_of_a_busy_multiplexer_is_a_wrong_answer(dialogue, opened):
    dialogue.expect((b"2\r", b"918\r"), (b"2\r", VALUE))
    with pytest.raises(WrongAnswer, match=r"busy \(918\)"):
        await opened.read_once()
    assert (await opened.read_once()).value_mm == 0.123
