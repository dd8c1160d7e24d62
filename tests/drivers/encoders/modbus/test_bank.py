"""Encoders with Modbus RTU on a pseudo-terminal: requests, one instant, faults of devices and line."""

from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.encoders.modbus import ModbusBank, RegisterSpan, counts_in, register_spans
from drivers.errors import BusError, InvalidSampleError, SilentNodeError
from drivers.interfaces import DeviceIdentity
from drivers.serial import modbus_port
from drivers.serial.modbus_port import RefusedRequest
from drivers.simulated.encoders.modbus_bank import ModbusScales, SimulatedModbusBank
from drivers.simulated.gauges.described import refusal
from drivers.wire_trace import TrafficDirection, WireTrace
from hexacell.cell.described_devices import ModbusEncoderSettings
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.clock import CellClock
from hexacell.errors import UsageError

FAST = 100.0
ONE_DEVICE = {"registers": (100, 102, 104, 106, 108, 110)}
TWO_DEVICES = {"registers": (0, 2, 4, 0, 2, 4), "devices": (7, 7, 7, 8, 8, 8)}


def modbus_settings(timeout_s: float = 0.5, **modbus: Any) -> LinearEncoderSettings:
    return LinearEncoderSettings.model_validate(
        {"protocol": "modbus", "timeout_s": timeout_s, "modbus": {**ONE_DEVICE, **modbus}}
    )


class Simulated:
    """Six simulated encoders, at 10, 20 and so on mm, and their driver."""

    def __init__(self, changes: dict[str, Any], *, timeout_s: float = 0.5, **modbus: Any) -> None:
        self.positions: Sequence[float] = [10.0 * leg for leg in range(1, 7)]
        settings = modbus_settings(timeout_s, **modbus).model_copy(update=changes)
        assert settings.modbus is not None
        self.bank = SimulatedModbusBank(settings, settings.modbus, lambda: self.positions, CellClock(FAST))
        self.settings = settings.model_copy(update={"modbus": self.bank.described})
        self.trace = WireTrace()
        self.driver = ModbusBank(self.settings, self.trace)

    @property
    def requests(self) -> list[bytes]:
        """What was sent so far, without checksums."""
        return [
            entry.data[:-2] for entry in self.trace.entries() if entry.direction is TrafficDirection.SENT
        ]


@pytest.fixture
async def simulated():
    """Makes simulated encoders with a driver, by changes of ``[encoders]`` and keys of its ``modbus``."""
    made = []

    def make(changes: dict[str, Any] | None = None, **modbus: Any) -> Simulated:
        made.append(Simulated(changes or {}, **modbus))
        return made[-1]

    yield make
    for one in made:
        await one.driver.close()
        one.bank.close()


LATCH = {"register": 9, "value": 1, "delay_s": 0.0}
ALL = tuple(10.0 * leg for leg in range(1, 7))
SAMPLES = 10


async def read_often(bank: ModbusBank) -> None:
    for _ in range(SAMPLES):
        await bank.read()


async def test_six_positions_of_one_device_come_in_one_answer(simulated):
    cell = simulated()
    identities = await cell.driver.open()
    assert identities[2] == DeviceIdentity("encoder of leg 3", "modbus", "device 1, register 104")
    sample = await cell.driver.read()
    assert sample.positions == pytest.approx(ALL)
    assert sample.counts == tuple(10_000 * leg for leg in range(1, 7))
    assert cell.requests == [bytes.fromhex("01 04 00 64 00 0c")] * 2


async def test_several_devices_are_told_to_keep_their_positions_of_one_instant(simulated):
    cell = simulated(latch=LATCH, **TWO_DEVICES)
    await cell.driver.open()
    cell.positions = [-2.5] * 6
    assert (await cell.driver.read()).positions == pytest.approx((-2.5,) * 6)
    latch, one, other = (
        bytes.fromhex(f"{text}") for text in ("00 06 00 09 00 01", "07 04 00 00 00 06", "08 04 00 00 00 06")
    )
    assert cell.requests == [latch, one, other] * 2


async def test_without_that_they_are_asked_there_and_back(simulated):
    """Each answer is a step later; the mean of both is where all were in the middle."""
    cell = simulated(**TWO_DEVICES)
    await cell.driver.open()
    passed = iter(range(4))
    cell.bank._positions = lambda: [5.0 + 0.01 * next(passed)] * 6
    sample = await cell.driver.read()
    assert sample.positions == pytest.approx((5.015,) * 6)
    assert [request[0] for request in cell.requests[-4:]] == [7, 8, 8, 7]


async def test_a_device_that_refuses_registers_between_is_asked_leg_by_leg(simulated, monkeypatch):
    held = ModbusScales._registers
    places = {0, 1, 10, 11, 20, 21, 30, 31, 40, 41, 50, 51}
    monkeypatch.setattr(
        ModbusScales, "_registers", lambda *of: {n: v for n, v in held(*of).items() if n in places}
    )
    cell = simulated(registers=(0, 10, 20, 30, 40, 50))
    await cell.driver.open()
    assert (await cell.driver.read()).positions == pytest.approx(ALL)
    assert cell.requests[0] == bytes.fromhex("01 04 00 00 00 34")
    assert cell.requests[-1] == bytes.fromhex("01 04 00 00 00 02")


@pytest.mark.parametrize(
    "keys", [{"word_order": "little"}, {"kind": "holding"}, {"bits": 16, "registers": (0, 1, 2, 3, 4, 5)}]
)
async def test_counts_are_what_the_cell_file_says(simulated, keys):
    cell = simulated(**keys)
    cell.positions = [-1.5, 2.0, -0.001, 0.0, 20.0, -20.0]
    await cell.driver.open()
    assert (await cell.driver.read()).positions == pytest.approx(cell.positions)


@pytest.mark.parametrize("fault", ["damaged", "cut short", "repeated", "NUL bytes"])
async def test_faults_of_the_line_change_no_position(simulated, monkeypatch, fault):
    cell = simulated()
    await cell.driver.open()
    monkeypatch.setattr(cell.driver._session._port, "worst_latency_s", 0.1)
    cell.bank.faults(1)[fault](on=True)
    for step in range(SAMPLES):
        cell.positions = [0.25 * step] * 6
        assert (await cell.driver.read()).positions == pytest.approx((0.25 * step,) * 6)


async def test_a_frame_from_before_is_never_taken_for_the_answer(simulated, monkeypatch):
    cell = simulated()
    await cell.driver.open()
    await cell.driver.read()
    monkeypatch.setattr(cell.driver._session._port, "worst_latency_s", 0.1)
    cell.bank.faults(1)["unasked"](on=True)
    cell.positions = [5.0] * 6
    assert (await cell.driver.read()).positions == pytest.approx((5.0,) * 6)  # it was asked again
    cell.positions = [6.0] * 6
    assert (await cell.driver.read()).positions == pytest.approx((6.0,) * 6)
    cell.positions = [5.0] * 6
    cell.bank.faults(1)["unasked"](on=False)
    assert (await cell.driver.read()).positions == pytest.approx((5.0,) * 6)


async def test_a_late_answer_is_not_that_of_the_next_request(simulated, monkeypatch):
    cell = simulated(timeout_s=0.1)
    await cell.driver.open()
    monkeypatch.setattr(cell.driver._session._port, "worst_latency_s", 0.3)
    cell.bank.faults(1)["late"](on=True)
    with pytest.raises(SilentNodeError, match=r"does not answer within 0\.1 s"):
        await read_often(cell.driver)
    cell.bank.faults(1)["late"](on=False)
    cell.positions = [1.75] * 6
    assert (await cell.driver.read()).positions == pytest.approx((1.75,) * 6)


@pytest.mark.parametrize(
    ("fault", "error", "message"),
    [
        ("silent", SilentNodeError, r"encoders of legs 1, 2, 3 \(device 7\): does not answer within 0.5 s"),
        ("alarm", InvalidSampleError, "encoder of leg 3: shows -1, which means no valid position"),
        ("jumped", InvalidSampleError, "encoder of leg 3: jumped from 30.000 to 430.000 mm"),
        ("unplugged", BusError, r"encoders: port .* was lost .*Plug it in and open .*is void"),
    ],
)
async def test_a_fault_names_the_leg_and_they_can_be_opened_again(simulated, fault, error, message):
    cell = simulated({"largest_speed": 1.0}, invalid=(-1,), latch=LATCH, **TWO_DEVICES)
    await cell.driver.open()
    await cell.driver.read()
    cell.bank.faults(3)[fault](on=True)
    with pytest.raises(error, match=message):
        await cell.driver.read()
    cell.bank.faults(3)[fault](on=False)
    await cell.driver.open()
    assert (await cell.driver.read()).positions == pytest.approx(ALL)


async def test_a_register_that_is_not_there_is_told(simulated):
    cell = simulated()
    wrong = cell.settings.modbus.model_copy(update={"registers": (900, 902, 904, 906, 908, 910)})
    bank = ModbusBank(cell.settings.model_copy(update={"modbus": wrong}))
    message = r"encoder of leg 1 \(device 1\): device 1 answers exception 2 \(illegal data address\)"
    with pytest.raises(RefusedRequest, match=message):
        await bank.open()


def refuse(monkeypatch, code, times=1000):
    """Have the devices refuse requests, all or some, with an exception; what they were asked."""
    answer, asked = ModbusScales.answer, list[bytes]()

    def refused(scales, command):
        asked.append(command)
        return answer(scales, command) if len(asked) > times else refusal(command[0], command[1], code)

    monkeypatch.setattr(modbus_port, "PAUSE_S", 0.0)
    monkeypatch.setattr(ModbusScales, "answer", refused)
    return asked


async def test_a_line_on_which_nothing_answers_is_told_and_not_its_first_device(simulated):
    cell = simulated(latch=LATCH, timeout_s=0.05, **TWO_DEVICES)
    cell.bank.faults(1)["silent"](on=True)
    cell.bank.faults(4)["silent"](on=True)
    with pytest.raises(SilentNodeError, match=r"^each of the encoders: does not answer.*the adapter"):
        await cell.driver.open()


async def test_what_came_in_place_of_frames_decides_the_advice(simulated, monkeypatch):
    monkeypatch.setattr(ModbusScales, "answer", lambda *_: b":010404\r\n")
    monkeypatch.setattr("drivers.serial.modbus_port.TIMES_ASKED", 1)
    with pytest.raises(SilentNodeError, match=r"answers Modbus ASCII.*Set it to Modbus RTU"):
        await simulated(timeout_s=0.25).driver.open()


async def test_a_busy_device_is_asked_again(simulated, monkeypatch):
    cell = simulated()
    refuse(monkeypatch, 6, times=3)
    await cell.driver.open()
    assert (await cell.driver.read()).positions == pytest.approx(ALL)


REFUSED = {1: "Correct", 4: "Switch", 5: "End", 6: "End", 8: "Switch", 10: "behind", 11: "behind", 77: ""}


@pytest.mark.parametrize(("code", "told"), REFUSED.items())
async def test_other_exceptions_do_not_mean_absence(simulated, monkeypatch, code, told):
    cell = simulated(registers=(0, 10, 20, 30, 40, 50))
    asked = refuse(monkeypatch, code)
    with pytest.raises(RefusedRequest, match=rf"answers exception {code} .*{told}.*look it up"):
        await cell.driver.open()
    assert {command[2:6] for command in asked} == {bytes.fromhex("00 00 00 34")}
    assert len(asked) == (4 if code in {5, 6} else 1)


async def test_what_the_cell_file_lacks_is_told():
    with pytest.raises(BusError, match="encoders: have no port"):
        await ModbusBank(modbus_settings()).open()
    with pytest.raises(BusError, match="encoders: port /dev/nowhere is absent"):
        await ModbusBank(modbus_settings(port="/dev/nowhere")).open()
    with pytest.raises(UsageError, match="in which registers the encoders are"):
        await ModbusBank(LinearEncoderSettings(protocol="modbus")).open()


def test_requests_are_as_few_as_answers_allow():
    described = ModbusEncoderSettings(registers=(0, 2, 4, 200, 202, 204), devices=(1, 1, 1, 1, 1, 2))
    assert register_spans(described, joined=True) == (
        RegisterSpan(1, 0, 6, (1, 2, 3)),
        RegisterSpan(1, 200, 4, (4, 5)),
        RegisterSpan(2, 204, 2, (6,)),
    )
    assert len(register_spans(described, joined=False)) == 6


@given(st.integers(-(2**31), 2**31 - 1), st.sampled_from(["big", "little"]))
def test_every_count_is_understood(count, order):
    described = ModbusEncoderSettings(registers=(0, 2, 4, 6, 8, 10), word_order=order)
    data = count.to_bytes(4, signed=True)
    words = data if order == "big" else data[2:] + data[:2]
    span = RegisterSpan(1, 0, 2, (1,))
    assert counts_in(words, span, described, signed=True) == {1: count}
    assert counts_in(words, span, described, signed=False) == {1: count % 2**32}
