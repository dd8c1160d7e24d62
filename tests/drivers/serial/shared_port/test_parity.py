"""Parity: pyserial sends it and never checks it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import WrongAnswer
from drivers.gauges.protocol import FrameRejected
from drivers.gauges.sylvac import SylvacGauge
from drivers.serial.opening import DAMAGED, ParityInBit7, in_software
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import FileError
from tests.drivers.gauges.sylvac.conftest import OPENING
from tests.drivers.serial.shared_port.conftest import LONG_S, WORST_LATENCY_S, FakePort

characters = st.binary(max_size=20).map(lambda data: bytes(byte & 0x7F for byte in data))


@pytest.mark.parametrize("odd", [0, 1])
@given(data=characters)
def test_what_is_sent_with_parity_is_received(odd: int, data: bytes) -> None:
    parity = ParityInBit7(odd)
    assert parity.decode(parity.encode(data)) == data
    assert all((byte.bit_count() + odd) % 2 == 0 for byte in parity.encode(data))


@given(value=st.floats(-99, 99), place=st.integers(0, 7), bit=st.integers(0, 7))
def test_no_single_wrong_bit_of_a_value_is_accepted(value: float, place: int, bit: int) -> None:
    parity, frame = ParityInBit7(0), f"{value:+.3f}\r".encode()
    sent = bytearray(parity.encode(frame))
    sent[place % len(sent)] ^= 1 << bit
    received = parity.decode(bytes(sent))
    assert received.count(DAMAGED) == 1
    gauge = SylvacGauge(GaugeSettings(name="y", axis="y", protocol="sylvac"), SharedSerialPorts())
    with pytest.raises(FrameRejected):
        gauge._parse_value(received)


def test_a_line_of_seven_bits_is_opened_with_eight() -> None:
    settings: dict[str, object] = {"parity_check": "software", "bytesize": 7, "parity": "E", "stopbits": 2}
    assert in_software(settings) is not None
    assert settings == {"bytesize": 8, "parity": "N", "stopbits": 2}
    plain: dict[str, object] = {"bytesize": 7, "parity": "E"}
    assert in_software(plain) is None
    assert plain == {"bytesize": 7, "parity": "E"}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"parity_check": "always"}, "'always' is unknown"),
        ({"parity_check": "software", "bytesize": 8, "parity": "E"}, "wants 7 bits and a parity"),
        ({"parity_check": "software", "bytesize": 7, "parity": "N"}, "wants 7 bits and a parity"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings: dict[str, object], words: str) -> None:
    with pytest.raises(FileError, match=words):
        in_software(settings)


class DamagingPort(FakePort):
    """A gauge with even parity behind a line of eight bits; some of its answers are damaged."""

    def __init__(self) -> None:
        super().__init__(self._answered)
        self.answers = dict(OPENING)
        self.parity = ParityInBit7(0)
        self.wrong_bits = 0

    def _answered(self, request: bytes) -> list[tuple[float, bytes]]:
        answer = self.answers.get(self.parity.decode(request), b"+1.234\r")
        sent = bytearray(self.parity.encode(answer))
        if self.wrong_bits:
            sent[2] ^= 0x01
            self.wrong_bits -= 1
        return [(0.0, bytes(sent))]


async def test_a_gauge_behind_a_network_server_is_read_with_its_parity(fake) -> None:
    port = fake(DamagingPort())
    links = SharedSerialPorts(worst_latency_s=WORST_LATENCY_S)
    serial = {"parity_check": "software"}
    settings = GaugeSettings(
        name="x", axis="x", protocol="sylvac", port="fake", serial=serial, timeout_s=LONG_S
    )
    gauge = SylvacGauge(settings, links)
    await gauge.open()
    assert (port.settings["bytesize"], port.settings["parity"]) == (8, "N")
    port.wrong_bits = 2
    assert (await gauge.read()).value_mm == 1.234
    port.wrong_bits = 3
    with pytest.raises(WrongAnswer, match="Check parity settings"):
        await gauge.read()
    await gauge.close()
    await links.close()
