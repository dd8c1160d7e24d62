"""Encoders by a DBC file are read as the file says; messages and files that do not fit are told."""

import asyncio
import struct
from collections.abc import Callable

import pytest

from drivers.encoders.dbc import DbcBank
from drivers.errors import BusError, InvalidSampleError, SilentNodeError
from drivers.interfaces import DeviceIdentity
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.errors import DeviceError, FileError, UsageError
from tests.drivers.encoders.dbc.conftest import FIRST_ID, HEAD, SIGNALS, Wire, dbc_text
from tests.waiting import until

POSITIONS = (1.5, -2.0, 3.0, 4.0, 5.0, 6.0)


async def while_sending(wire: Wire, call: Callable, **sent):
    """The result of a call while the encoders send."""
    task = asyncio.create_task(call())

    def is_done() -> bool:
        wire.send_all(POSITIONS, **sent)
        return task.done()

    await until(is_done)
    return task.result()


async def test_six_positions_are_read_with_the_factor_of_the_file(simulated):
    cell = simulated()
    identities = await cell.driver.open()
    assert identities[2] == DeviceIdentity(
        "encoder of leg 3", "dbc", "ENC3.Position", settings="steps of 0.0005 mm, offset 0"
    )
    sample = await cell.driver.read()
    assert sample.positions == pytest.approx((10.0, 20.0, 30.0, 40.0, 50.0, 60.0))
    assert sample.counts == (20000, 40000, 60000, 80000, 100000, 120000)


async def test_the_request_is_on_the_wire(settings, wire):
    bank = DbcBank(settings(wire.settings, request="123#A0B1"))
    opening = asyncio.create_task(bank.open())
    message = await asyncio.to_thread(wire.received, 5.0)
    assert (message.arbitration_id, bytes(message.data)) == (0x123, b"\xa0\xb1")
    with pytest.raises(SilentNodeError, match=r"bit rate, and request in \[encoders\.dbc\]"):
        await opening
    await bank.close()


@pytest.mark.parametrize(
    ("window_s", "sent", "error", "told"),
    [
        (1.0, {"without": 5}, SilentNodeError, "leg 5"),
        (1.0, {"length": 5}, InvalidSampleError, "sends 5 bytes, where the DBC file has 6"),
        (1e-9, {}, DeviceError, r"encoders: send \d+ ms apart"),
    ],
)
async def test_what_is_no_sample_of_six_is_told(settings, wire, window_s, sent, error, told):
    bank = DbcBank(settings(wire.settings, window_s=window_s))
    with pytest.raises(error, match=told):
        await while_sending(wire, bank.open, **sent)


@pytest.mark.parametrize(("frame", "told"), [(None, "CAN adapter"), (0x700, "but others do.*DBC")])
async def test_a_bus_without_any_encoder_is_told_and_not_the_first_leg(settings, wire, frame, told):
    bank = DbcBank(settings(wire.settings))
    opening = asyncio.create_task(bank.open())
    while frame and not (bank._session and bank._session._hears_others):
        wire.send(frame, b"")
        await asyncio.sleep(0)
    with pytest.raises(SilentNodeError, match=f"^each encoder: sends nothing .*{told}"):
        await opening


async def test_a_message_that_comes_without_its_signal_is_told_as_that(settings, dbc_file, wire):
    text = dbc_text().replace("Error :", "Error M :").replace("Position :", "Position m1 :")
    dbc_file.write_text(text.replace(" SG_ Error", ' SG_ Heat m0 : 0|8@1+ (1,0) [0|0] "" PC\n SG_ Error'))
    with pytest.raises(SilentNodeError, match=r"leg 6 .*not with this signal. Correct signals"):
        await while_sending(wire, DbcBank(settings(wire.settings)).open)


async def test_a_position_outside_the_range_of_the_file_is_refused(settings, wire):
    bank = DbcBank(settings(wire.settings))
    await while_sending(wire, bank.open)
    reading = asyncio.create_task(bank.read())

    def is_done() -> bool:
        wire.send(0x203, (4_100_000).to_bytes(4, "little") + b"\0\0")
        return reading.done()

    await until(is_done)
    with pytest.raises(InvalidSampleError, match=r"leg 3.*sends 2050, outside the range in the DBC file"):
        await reading
    await bank.close()


@pytest.mark.parametrize(
    ("text", "signals", "message"),
    [
        ("hello {", SIGNALS, "cannot be read"),
        (dbc_text(), ("ENC9.Position", *SIGNALS[1:]), r"has no message 'ENC9'. Did you mean 'ENC\d'"),
        (dbc_text(), ("ENC1.Positon", *SIGNALS[1:]), r"has no signal 'Positon'. Did you mean 'Position'"),
        (dbc_text("inch"), SIGNALS, "signal ENC1.Position is in inch, where joints are in mm"),
        (dbc_text("um"), SIGNALS, "signal ENC1.Position has finer steps"),
    ],
)
async def test_a_file_that_does_not_fit_is_told(settings, dbc_file, wire, text, signals, message):
    dbc_file.write_text(text)
    with pytest.raises(FileError, match=message):
        await DbcBank(settings(wire.settings, signals=signals)).open()


async def test_messages_of_one_name_are_refused_and_nothing_is_printed(settings, dbc_file, wire, capfd):
    again = dbc_text("m").removeprefix(HEAD)  # which of the two units holds nobody knows
    dbc_file.write_text(dbc_text() + again)
    with pytest.raises(FileError, match="has message 'ENC1' twice"):
        await DbcBank(settings(wire.settings)).open()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("sent", "told"), [("nan", "nan"), ("-inf", "-inf"), ("3.4e38", "3.4e[+]38")])
async def test_a_floating_point_number_that_is_no_position_is_told(settings, dbc_file, wire, sent, told):
    text = dbc_text().replace("(0.0005,0) [-2000|2000]", "(1,0) [0|0]")
    dbc_file.write_text(
        text + "".join(f"SIG_VALTYPE_ {FIRST_ID + leg} Position : 1;\n" for leg in range(6))
    )
    bank = DbcBank(settings(wire.settings))
    opening = asyncio.create_task(bank.open())

    def is_done() -> bool:
        for leg in range(6):
            wire.send(FIRST_ID + leg, struct.pack("<f", float(sent)) + b"\0\0")
        return opening.done()

    await until(is_done)
    with pytest.raises(InvalidSampleError, match=f"leg 1 .*sends {told}, which is no position"):
        await opening


OVERLAPPING = ' SG_ Again : 16|8@1+ (1,0) [0|255] "" PC\n'


async def test_only_messages_that_are_used_must_not_contradict_themselves(settings, dbc_file, wire):
    other = f'BO_ 999 OTHER: 4 ENC\n SG_ Whole : 0|32@1- (1,0) [0|0] "" PC\n{OVERLAPPING}'
    dbc_file.write_text(dbc_text() + other, encoding="utf-8-sig")
    bank = DbcBank(settings(wire.settings))
    await while_sending(wire, bank.open)
    await bank.close()
    dbc_file.write_text(dbc_text() + OVERLAPPING)
    with pytest.raises(FileError, match=r"The signals \w+ and \w+ are overlapping in message ENC6\."):
        await DbcBank(settings(wire.settings)).open()


async def test_metres_become_millimetres(settings, dbc_file, wire):
    dbc_file.write_text(dbc_text("m"))
    bank = DbcBank(settings(wire.settings))
    await while_sending(wire, bank.open)
    assert (await while_sending(wire, bank.read)).positions[0] == pytest.approx(1500.0)
    await bank.close()


async def test_without_bus_or_description_the_cell_file_is_told(settings):
    with pytest.raises(BusError, match="not configured"):
        await DbcBank(settings()).open()
    with pytest.raises(UsageError, match="messages are not stated"):
        await DbcBank(LinearEncoderSettings(protocol="dbc")).open()
