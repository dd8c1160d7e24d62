"""CDI and Starrett indicators: the unit in every answer, and parameters."""

import pytest

from drivers.errors import GaugeSilent, WrongSetting, ZeroVoid
from drivers.gauges.cdi import CdiGauge, Parameter, parse_parameter
from drivers.gauges.protocol import FrameRejected
from drivers.interfaces import DeviceIdentity, GaugeReading
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings

VALUE = b"+  2.1380, MM\r\n"
PARAMETERS = {b"?p011\r": b"0\r\n", b"?p019\r": b"0\r\n", b"?p021\r": b"0\r\n", b"?p040\r": b"0\r\n"}


def opening(value=VALUE, **answers):
    parameters = [(ask, answers.get(ask[1:5].decode(), answer)) for ask, answer in PARAMETERS.items()]
    return [(b"R\r", value), *parameters]


@pytest.fixture
async def gauge(links, settings):
    return CdiGauge(settings("cdi"), links)


@pytest.fixture
async def opened(dialogue, gauge):
    dialogue.expect(*opening())
    await gauge.open()
    return gauge


# Frames

parse_value = CdiGauge(GaugeSettings(name="y", axis="y", protocol="cdi"), SharedSerialPorts())._parse_value


@pytest.mark.parametrize("frame", [b"1\r", b"p021=1\r", b"P021 = 1\r", b"p021=001\r"])
def test_a_parameter_is_read_bare_or_named(frame):
    assert parse_parameter(frame, Parameter.HOLD) == 1


@pytest.mark.parametrize("frame", [b"NOT FOUND\r", b"NO ACCESS\r"])
def test_an_unknown_parameter_is_parsed_as_none(frame):
    assert parse_parameter(frame, Parameter.HOLD) is None


@pytest.mark.parametrize(
    "frame", [b"p019=1\r", b"SUCCESS\r", b"1.5\r", b"\r", b"1\xb2\r", b"OUT OF BOUNDS\r"]
)
def test_malformed_parameters_are_rejected(frame):
    with pytest.raises(FrameRejected):
        parse_parameter(frame, Parameter.HOLD)


# Dialogues


async def test_opening_identifies_the_gauge_and_reading_gives_its_value(dialogue, gauge):
    dialogue.expect(*opening(), (b"R\r", VALUE), (b"R\r", VALUE))
    assert await gauge.open() == DeviceIdentity("y", "cdi", "CDI or Starrett indicator")
    assert await gauge.read() == GaugeReading(2.138, "+  2.1380, MM")


async def test_an_older_indicator_without_parameters_is_accepted(dialogue, gauge):
    dialogue.expect((b"R\r", VALUE), (b"?p011\r",), (b"?p011\r",), (b"R\r", VALUE))
    await gauge.open()
    await gauge.check()


async def test_one_lost_answer_or_denial_does_not_mean_that_there_are_no_parameters(dialogue, gauge):
    asked = opening(p021=b"1\r\n")
    dialogue.expect(asked[0], (b"?p011\r",), *asked[1:], *2 * asked)
    with pytest.raises(WrongSetting, match="hold"):
        await gauge.open()
    asked = opening(p021=b"1\r\n")
    dialogue.expect(*asked[:3], (b"?p021\r", b"NOT FOUND\r\n"), *asked[3:], *2 * asked)
    with pytest.raises(WrongSetting, match="hold"):
        await gauge.open()


async def test_an_answer_of_which_only_the_line_end_came_is_damage_and_no_silence(dialogue, opened):
    asked = opening()
    dialogue.expect(asked[0], (b"?p011\r", b"\r\n"), *asked[1:])
    await opened.check()


async def test_an_indicator_that_has_reported_parameters_must_still_do_so(dialogue, opened):
    dialogue.expect((b"R\r", VALUE), (b"?p011\r",))
    with pytest.raises(GaugeSilent):
        await opened.check()


async def test_the_unit_is_requested_with_the_plunger_at_its_end(dialogue, gauge):
    at_end = opening(b"OUT OF BOUNDS\r\n")
    dialogue.expect(*[at_end[0], (b"?p013\r", b"1\r\n"), *at_end[1:]] * 3)
    with pytest.raises(WrongSetting):
        await gauge.open()
    dialogue.expect(at_end[0], (b"?p013\r", b"2\r\n"), *at_end[1:])
    await gauge.open()


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"p021": b"1\r\n"}, "is on hold"),
        ({"p011": b"1\r\n"}, "is in mode TIR"),
        ({"p011": b"7\r\n"}, "is in mode 7"),
        ({"p040": b"1\r\n"}, "multiplies"),
    ],
)
async def test_settings_that_falsify_readings_are_refused(dialogue, gauge, answers, words):
    dialogue.expect(*opening(**answers) * 3)
    with pytest.raises(WrongSetting, match=words):
        await gauge.open()


@pytest.mark.parametrize(
    ("answers", "words"),
    [({"p019": b"1\r\n"}, "reversed False -> True"), ({"p011": b"2\r\n"}, "mode ABS -> INCR")],
)
async def test_a_setting_changed_during_a_set_voids_the_zero(dialogue, opened, answers, words):
    dialogue.expect(*opening(**answers) * 3)
    with pytest.raises(ZeroVoid, match=words):
        await opened.check()
