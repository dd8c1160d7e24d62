"""No sample counts after an emergency, alarm, boot-up or lost heartbeat, and the device is told."""

import math
from typing import Any

import pytest

from drivers.encoders import node_monitor
from drivers.encoders.can_bus import ERROR_FRAMES
from drivers.encoders.cia406 import Cia406Bank, EncoderSession
from drivers.encoders.node_monitor import AlarmTiming, advice_for
from drivers.encoders.object_dictionary import ALARMS, ERROR_REGISTER, WARNINGS
from drivers.errors import BusError, InvalidSampleError, RestartedNodeError, SilentNodeError
from tests.waiting import until

NO_MAGNET = bytes.fromhex("00ff210000000000")
CLEARED = bytes(8)
PERIOD_S = 0.02


async def test_an_emergency_makes_samples_invalid_until_it_is_cleared(raw, opened):
    raw.send(0x83, NO_MAGNET)
    await raw.delivered_to(opened)
    for _ in range(2):
        with pytest.raises(InvalidSampleError, match=r"leg 3 .*: reports emergency FF00 \(no magnet"):
            await opened.read()
    raw.send(0x83, CLEARED)
    await raw.delivered_to(opened)
    await opened.read()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("3081110000000000", "8130 .its heartbeat monitoring tripped, error register 0x11"),
        ("0042090000000000", "4200 .temperature.*Let it cool"),
        ("0000200000000000", "0000 .*error register 0x20"),  # one error gone, another is left
        ("00ff", "FF00 .no magnet, error register 0xff"),
        ("", "emergency FFFF"),
    ],
)
async def test_an_emergency_that_is_no_complete_reset_is_an_error(raw, opened, data, words):
    raw.send(0x81, bytes.fromhex(data))
    await raw.delivered_to(opened)
    with pytest.raises(InvalidSampleError, match=rf"leg 1 .*{words}"):
        await opened.read()


R, A, W = ERROR_REGISTER, ALARMS, WARNINGS
ADVICE = {
    "short circuit": {(R, 0, "2310"), (R, 0x02, "1000")},
    "voltage of its supply": {(R, 0, "3120"), (R, 0x05, "FF01")},
    "Let it cool": {(R, 0, "4200"), (R, 0x09, "0000")},
    "Switch it off and on": {(R, 0, "5200"), (R, 0, "6010"), (W, 0x04, "")},
    "termination and bit rate": {(R, 0, "8120"), (R, 0, "8140")},
    "heartbeat consumer": {(R, 0, "8130")},
    "node id of its own": {(R, 0, "8150")},
    "vendor's tool": {(R, 0, "8210"), (R, 0, "8240")},
    "magnet, distance, dirt": {(R, 0, "FF00"), (A, 0x0001, ""), (W, 0x02, "")},
    "Look up what it means": {(R, 0, "FF77"), (R, 0x81, "9000"), (A, 0x1000, ""), (W, 0x20, "")},
    "lower speed": {(W, 0x01, "")},
    "replace it soon": {(W, 0x08, "")},
    "Change its battery": {(W, 0x10, "")},
}


@pytest.mark.parametrize("told", ADVICE)
def test_what_a_device_says_of_itself_decides_what_to_do(told):
    assert all(told in advice_for(*said) for said in ADVICE[told])


async def test_an_emergency_during_a_sample_makes_it_invalid(raw, opened):
    def report_then_answer(_sync):
        raw.send(0x86, NO_MAGNET)
        return [bytes(4)]

    raw.nodes[6].answers_sync = report_then_answer
    with pytest.raises(InvalidSampleError, match=r"leg 6"):
        await opened.read()


async def test_the_alarms_are_read_after_an_emergency(raw, bank, monkeypatch):
    monkeypatch.setattr(EncoderSession, "alarm_timing", AlarmTiming(60.0))
    for node in raw.nodes.values():
        node.objects[0x6503, 0] = bytes(2)
    await bank.open()
    raw.nodes[3].objects[0x6503, 0] = b"\x01\x00"
    await bank.read()  # no emergency, and the last poll is recent
    raw.send(0x83, NO_MAGNET)
    raw.send(0x83, CLEARED)
    await raw.delivered_to(bank)
    with pytest.raises(InvalidSampleError, match=r"leg 3 .*6503h:0 is 0x0001"):
        await bank.read()
    raw.nodes[3].objects[0x6503, 0] = bytes(2)
    await bank.read()


@pytest.fixture
def alarms_read_always(monkeypatch):
    monkeypatch.setattr(EncoderSession, "alarm_timing", AlarmTiming(0.0, math.inf, 1))


async def test_alarms_without_an_emergency_are_found(raw, bank, alarms_read_always):
    for node in raw.nodes.values():
        node.objects[0x6503, 0] = bytes(2)
    await bank.open()
    await bank.read()
    raw.nodes[5].objects[0x6503, 0] = b"\x00\x10"
    with pytest.raises(InvalidSampleError, match=r"leg 5 .*0x1000"):
        await bank.read()


async def test_a_boot_up_voids_the_set_until_opened_again(raw, opened):
    raw.send(0x702, b"\x00")
    await raw.delivered_to(opened)
    for _ in range(2):
        with pytest.raises(RestartedNodeError, match=r"leg 2 \(node 2\).*the set is void"):
            await opened.read()
    await opened.open()
    await opened.read()


async def test_a_boot_up_ends_a_waiting_sample(raw, make_bank):
    bank = make_bank(timeout_s=10.0)
    await bank.open()
    raw.nodes[2].answers_sync = lambda _: raw.send(0x702, b"\x00") or []
    with pytest.raises(RestartedNodeError):
        await bank.read()


async def test_a_boot_up_during_configuration_is_detected(raw, bank):
    answer = raw.nodes[2].answer_sdo

    def reboot_once(request):
        if request[:3] == b"\x2f\x01\x18":
            raw.send(0x702, b"\x00")
        return answer(request)

    raw.nodes[2].answer_sdo = reboot_once
    with pytest.raises(RestartedNodeError, match=r"leg 2"):
        await bank.open()


@pytest.mark.parametrize("state", [b"\x7f", b"\x04", b"\x00"])
async def test_a_node_that_leaves_operational_has_lost_its_configuration(raw, opened, state):
    raw.send(0x704, b"\x05")
    await raw.delivered_to(opened)
    await opened.read()
    raw.send(0x704, state)
    await raw.delivered_to(opened)
    with pytest.raises(RestartedNodeError, match=r"leg 4"):
        await opened.read()


class Heartbeats:
    """Heartbeats of the nodes in ``beating``, on a clock of the driver's that nothing else moves."""

    def __init__(self, raw: Any) -> None:
        self.beating = set(raw.nodes)
        self._raw = raw
        self._now_s = 1000.0

    def monotonic(self) -> float:
        return self._now_s

    async def advance(self, bank: Any, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self._now_s += PERIOD_S
            for node in self.beating:
                self._raw.send(0x700 + node, bytes([self._raw.nodes[node].state]))
            if self.beating:
                await self._raw.delivered_to(bank)


@pytest.fixture
def heartbeats(raw, monkeypatch):
    beating = Heartbeats(raw)
    monkeypatch.setattr(node_monitor, "time", beating)
    return beating


async def test_heartbeats_are_requested_and_their_loss_is_an_error(raw, make_bank, heartbeats):
    bank = make_bank(heartbeat_ms=20)
    await bank.open()
    assert raw.nodes[1].objects[0x1017, 0] == b"\x14\x00"
    await heartbeats.advance(bank, 0.4)
    await bank.read()
    heartbeats.beating.discard(5)
    await heartbeats.advance(bank, 0.24)
    await bank.read()
    await heartbeats.advance(bank, 0.04)
    told = r"leg 5 \(node 5\): no heartbeat for 0.26 s, but SDO requests are answered.*heartbeat_ms"
    with pytest.raises(SilentNodeError, match=told):
        await bank.read()


async def test_without_heartbeats_silence_is_no_fault(bank, heartbeats):
    await bank.open()
    heartbeats.beating.clear()
    await heartbeats.advance(bank, 3600.0 * PERIOD_S)
    await bank.read()


async def test_nodes_that_send_no_heartbeat_are_told_and_read(raw, make_bank, heartbeats):
    del raw.nodes[2].objects[0x1017, 0]  # as where it only answers to guarding
    raw.nodes[3].forgets.add((0x1017, 0))
    heartbeats.beating -= {2, 3}
    bank = make_bank(heartbeat_ms=20)
    told = ["not send a heartbeat (object 1017h:0)" in one.remark for one in await bank.open()]
    assert told == [node in {2, 3} for node in raw.nodes]
    await heartbeats.advance(bank, 0.4)
    assert (await bank.read()).counts[:3] == (1000, 2000, 3000)


async def test_a_warning_that_comes_during_a_run_makes_samples_invalid(raw, bank, alarms_read_always):
    for node in raw.nodes.values():
        node.objects[0x6505, 0] = b"\x01\0"  # told at opening
    await bank.open()
    await bank.read()
    raw.nodes[2].objects[0x6505, 0] = b"\x05\0"
    with pytest.raises(
        InvalidSampleError, match=r"leg 2 .*has a warning \(object 6505h:0 is 0x0005\).*off and on"
    ):
        await bank.read()


async def test_many_error_frames_are_a_failed_bus(raw, opened):
    for _ in range(ERROR_FRAMES - 1):
        raw.send(0x20, bytes(8), is_error_frame=True)
    await raw.delivered_to(opened)
    await opened.read()
    raw.send(0x20, bytes(8), is_error_frame=True)
    await until(lambda: has_failed(opened))
    with pytest.raises(BusError, match=r"has failed: 20 error frames within 1 s.*termination"):
        await opened.read()
    await opened.open()
    await opened.read()


def has_failed(bank: Cia406Bank) -> bool:
    assert bank._session is not None
    return bank._session.bus._failure is not None
