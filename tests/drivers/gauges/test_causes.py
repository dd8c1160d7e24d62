"""What is told of a serial line follows from what came over it: the true cause."""

import errno
import termios
from typing import Any

import pytest
import serial

from drivers.errors import GaugeSilent, PortLost, WrongAnswer
from drivers.gauges.cdi import CdiGauge
from drivers.gauges.described import RequestGauge, StreamGauge
from drivers.gauges.digimatic_usb import DigimaticUsbGauge
from drivers.gauges.mitutoyo_id_h import IdHGauge
from drivers.gauges.mux10 import Mux10Gauge
from drivers.gauges.sylvac import SylvacGauge
from drivers.serial.modbus_port import wrong_frame
from drivers.serial.opening import lost_port, opening_errors
from drivers.serial.received import SHOWN_BYTES, quoted
from drivers.simulated.gauges.described import ByRequest, Streaming, crc
from drivers.simulated.gauges.instruments import Indicator
from hexacell.cell.described_devices import RequestSettings, StreamSettings
from hexacell.errors import DeviceError
from tests.drivers.simulated.gauges.served.cell import cell

ASKED = {"ask": "?", "answer": r"X=([+-]?\d+\.\d+)", "example": "X=1.234\r"}
EXPONENT = {"ask": "?\n", "answer": "(.*)", "example": "1.234E-01\r\n", "ends_with": "\n"}
TOUCH = {"answer": r"X([+-]?\d+)", "example": "X+1234;", "ends_with": ";", "mm_per_unit": 0.01}
EVEN = bytes(byte | (byte.bit_count() % 2) << 7 for byte in b"-1.234\r\n")
ODD = bytes(byte | (1 - byte.bit_count() % 2) << 7 for byte in b"-1.234\r\n")

DIGIMATIC: Any = (DigimaticUsbGauge, "digimatic-usb", {})
MUX: Any = (Mux10Gauge, "mux10", {})
CDI: Any = (CdiGauge, "cdi", {})
SYLVAC: Any = (SylvacGauge, "sylvac", {})
ID_H: Any = (IdHGauge, "mitutoyo-id-h", {})
REQUEST = (RequestGauge, "request", {"request": ASKED})
NUMBER = (RequestGauge, "request", {"request": ASKED | {"answer": "X?=?(.*)"}})

CAUSES = [
    (DIGIMATIC, b"", r"does not answer within 0\.05 s.*settle_s"),
    (MUX, b"", "does not answer.*port, serial and protocol in the cell file"),
    (REQUEST, b"", "does not answer.*ask with its line end in the cell file"),
    (MUX, b"1\r", "only the echo of the request.*cable is not looped"),
    (SYLVAC, b"UNI?\r", "only the echo of the request"),
    (DIGIMATIC, EVEN, r"bit 7 set, as a parity: b'-1\.234\\r\\n'.*bytesize = 7, parity = \"E\""),
    (DIGIMATIC, ODD, 'parity = "O"'),
    (MUX, b"\x86\xf3\x1e\xe6\r", "bit 7 set. Check parity settings and baud rate: mux10 uses 9600"),
    (SYLVAC, b"\xff\xff\xff", "no characters. Check that its cable is wired right, and parity settings"),
    (SYLVAC, b"+0.123\r", "answers a question for a setting with .*Switch its continuous sending off"),
    (CDI, b"\0\0\0\0\r"[:4] + b"\xff", "no characters"),
    (MUX, b"01A+0000.123\n", "which ends with LF, where CR is expected"),
    (CDI, b"+  2.1380, MM\n", "which ends with LF, where CR is expected"),
    (REQUEST, b"X=1.234;", "ends with nothing, where CR is expected. Correct .*ends_with"),
    (DIGIMATIC, b"-1.234\r", "which ends with CR, where LF is expected"),
    (MUX, b"ERR\r", "so it does not know the question"),
    (ID_H, b"?\r", "so it does not know the question"),
    (ID_H, b"", "channel, the number that is set in it"),
    (REQUEST, b'-113,"Undefined header", unknown command\r', "so it does not know the question"),
    (DIGIMATIC, b"\x15\n", "so it does not know the question"),
    (CDI, b"01A+0000.123\r", r"answers b'01A\+0000\.123\\r' where protocol cdi has .*Correct protocol"),
    (MUX, b"login: \r", r"answers b'login: \\r' where protocol mux10"),
    (NUMBER, b"9.9E37\r", r"shows 9\.9E37, which is no length\. Look at its display"),
    (NUMBER, b"-99999999.999\r", "which is no length"),
    (REQUEST, b"Y=1.234\r", "Correct answer, protocol or port in the cell file"),
    (DIGIMATIC, b"# no data\n", "its adapter reports: no data"),
    (MUX, b"\x0201A+0000.123\r\x03", r"keeps sending unasked: b'[^']*\\x03' came last"),
    (MUX, b"911\r", r"does not answer its multiplexer \(911\)"),
]


@pytest.mark.parametrize(("gauge_of", "came", "told"), CAUSES)
async def test_the_cause_is_told(dialogue, links, settings, gauge_of, came, told):
    factory, protocol, described = gauge_of
    gauge = factory(settings(protocol, channel=1, **described), links)
    question = b"UNI?\r" if protocol == "sylvac" else gauge.value_request
    dialogue.expect(*[(question, came)] * 9)
    with pytest.raises(DeviceError, match=told):
        await gauge.open()
    dialogue.expected.clear()


async def test_one_that_answered_before_is_not_told_to_be_another(dialogue, links, settings):
    gauge = DigimaticUsbGauge(settings("digimatic-usb"), links)
    dialogue.expect((b"\n", b"-1.234\n"), (b"\n", b""))
    await gauge.open()
    with pytest.raises(GaugeSilent, match=r"where it did: b'-1\.234\\n' came last") as silent:
        await gauge.read()
    assert "cell file" not in str(silent.value)


async def test_what_else_answers_on_its_line_is_told(dialogue, links, settings):
    gauges = [IdHGauge(settings("mitutoyo-id-h", f"y{n}", channel=n), links) for n in (1, 2)]
    dialogue.expect((b"GA01\r\n", b"GN01,+0001.2345\r\n"), (b"GA02\r\n", b""))
    await gauges[0].open()
    with pytest.raises(GaugeSilent, match=r"while gauge y1 on it does.*its channel"):
        await gauges[1].open()


STREAMS = [
    (b"X1234;Y-567;Z0;", r"sends \d+ a second, in another form: b'[XYZ;\d-]+' came last.*ends_with"),
    (b"X=1234\r\n", r"sends b'X=1234' where protocol stream has answers like .*Correct answer"),
    (b"\xf8\x81\x00\x9c\n", "sends .*bytes with bit 7 set. Check parity settings and baud rate"),
]


@pytest.mark.parametrize(("sent", "told"), STREAMS)
async def test_what_a_stream_sends_is_told_instead_of_nothing(line, links, settings, sent, told):
    described = {"answer": r"X(-?\d+)", "example": "X1234", "mm_per_unit": 0.01}
    gauge = StreamGauge(settings("stream", stream=described, delay_s=0.0), links)
    line.repeats(sent)
    with pytest.raises(DeviceError, match=told):
        await gauge.open()


async def test_values_without_line_ends_are_read_where_their_end_is_stated(line, links, settings):
    gauge = StreamGauge(settings("stream", stream=TOUCH, delay_s=0.0), links)
    line.repeats(b"X1234;Y-567;Z0;")
    await gauge.open()
    assert (await gauge.read()).value_mm == pytest.approx(12.34)


@pytest.mark.parametrize("number", ["1.234E-01", "+.1234", "12.34e-02"])
async def test_numbers_are_read_as_instruments_write_them(dialogue, links, settings, number):
    gauge = RequestGauge(settings("request", request=EXPONENT), links)
    dialogue.expect(*[(b"?\n", number.encode() + b"\r\n")] * 3)
    await gauge.open()
    assert (await gauge.read()).value_mm == pytest.approx(0.1234)


def test_the_twin_sends_what_is_described():
    touch = Streaming({1: Indicator(lambda: -1.5)}, StreamSettings.model_validate(TOUCH))
    assert touch.unasked() == (b"X-0150;",)
    asked = ByRequest({1: Indicator(lambda: -1.5)}, RequestSettings.model_validate(EXPONENT))
    assert float(asked.answer(b"?")) == -1.5


FRAME = bytes.fromhex("07 04 04 00 00 03 e8")
FRAMES = [
    (b"", "only the echo", "Switch the device on"),
    (b":070404000003E8F2\r\n", "Modbus ASCII", "Set it to Modbus RTU"),
    (b"+1.234\r", "text, no Modbus", "Set it to Modbus RTU, or correct port"),
    (b"\x08" + FRAME[1:] + crc(b"\x08" + FRAME[1:]), "a frame of device 8, not 7", "Correct device"),
    (FRAME + crc(FRAME), "a whole frame that does not answer the request: 07 04", "other programs"),
    (b"\xff\xff", "no single frame", "no other device"),
    (FRAME + b"\0\1", "no single frame with a right checksum", "no other device has its address"),
]


@pytest.mark.parametrize(("received", "came", "action"), FRAMES)
def test_what_came_in_place_of_a_frame_is_told(received, came, action):
    what, advice = wrong_frame(received, 7)
    assert came in what
    assert action in advice


@pytest.mark.parametrize(("before", "after"), [(b"", b""), (b"\0", b""), (b"", b"\0\0\0")])
async def test_adapters_that_echo_or_add_zeros_to_frames_are_read(before, after):
    async with cell(["modbus"] * 3, timeout_s=0.5) as made:
        twin = made.rack.lines["x"].instrument
        answer = twin.answer
        twin.answer = lambda command: command + b"\0\0" + before + answer(command) + after
        await made.gauges["x"].open()
        assert (await made.gauges["x"].read()).value_mm == pytest.approx(1.0)


async def told_for(frame: bytes) -> str:
    """What is told of a line where every question is answered so, and a checksum."""

    def stated(_protocol: str, number: int) -> dict[str, Any]:
        described = {"register": 2 * number, "type": "float32", "mm_per_unit": 1.0}
        return {"modbus": described, "settle_s": 0.0}

    async with cell(["modbus"] * 3, timeout_s=0.5, stated=stated) as made:
        made.links.worst_latency_s = 0.01
        made.rack.lines["x"].instrument.answer = lambda _command: frame + crc(frame)
        with pytest.raises(WrongAnswer) as told:
            await made.gauges["x"].open()
    return str(told.value)


NO_NUMBERS = {"inf": "7f800000", "nan": "7fc00000", "-3.40282e+38": "ff7fffff"}


@pytest.mark.parametrize("shown", NO_NUMBERS)
async def test_floating_point_numbers_that_are_no_length_are_told(shown):
    assert f"= {shown}, which is no length" in await told_for(bytes.fromhex(f"010404{NO_NUMBERS[shown]}"))


@pytest.mark.parametrize("frame", ["0103043f800000", "018302"])
async def test_an_answer_to_another_function_is_none(frame):
    """Another master on the line asks holding registers, where this one asks input registers."""
    assert "a whole frame that does not answer the request" in await told_for(bytes.fromhex(frame))


async def test_flow_control_around_frames_is_no_answer(dialogue, links, settings):
    gauge = Mux10Gauge(settings("mux10", channel=1), links)
    value = b"\x13\x1101A+0000.123\r\x11"
    dialogue.expect((b"1\r", value), (b"V\r", b"\x11MUX-10\r\x11"), *[(b"1\r", value)] * 2)
    assert (await gauge.open()).description == "MUX-10"
    assert (await gauge.read()).value_mm == 0.123


async def test_modbus_that_is_only_echoed_names_the_echo():
    async with cell(["modbus"] * 3, timeout_s=0.1) as made:
        made.rack.lines["x"].instrument.answer = lambda command: command
        gauge = made.gauges["x"]
        gauge.settings = gauge.settings.model_copy(update={"settle_s": 0.0})
        with pytest.raises(GaugeSilent, match="only the echo of the request comes back"):
            await gauge.open()


PORTS = [
    (OSError(errno.ENOTTY, "Inappropriate ioctl"), "no serial port, or has no control lines"),
    (termios.error(errno.EIO, "Input/output error"), "no device behind it"),
    (serial.SerialException(errno.EAGAIN, "Could not exclusively lock port"), "in use. Close the other"),
    (serial.SerialException(errno.ENOENT, "reason"), "is absent. Plug it in"),
    (serial.SerialException(errno.EBUSY, "reason"), "is in use. Close the other program, or ModemManager"),
    (serial.SerialException(errno.EIO, "reason"), "cannot be opened: it has no device behind it"),
    (OSError(errno.EACCES, "Permission denied"), "may not be opened by this user"),
    (OSError(errno.ECONNREFUSED, "refused"), "no server that answers. Start it, check the network"),
    (OSError(errno.EMFILE, "Too many open files"), "no more files. Raise the limit"),
]


@pytest.mark.parametrize(("error", "told"), PORTS)
def test_why_a_port_cannot_be_opened_is_told(error, told):
    with pytest.raises(PortLost, match=told), opening_errors("gauge y", "/dev/ttyS9"):
        raise error


def test_a_port_that_another_program_reads_is_told():
    reason = "device reports readiness to read but returned no data (disconnected or multiple access?)"
    assert "any other program" in str(lost_port("gauge y", "/dev/ttyUSB0", reason))
    assert "no other client" in str(lost_port("gauge y", "socket://host:4001", "socket disconnected"))


def test_what_came_is_shown_in_part():
    assert quoted(b"\x1b[2J") == r"b'\x1b[2J'"
    assert len(quoted(b"x" * 5000)) < SHOWN_BYTES + 30
