"""What nodes report unasked, and what becomes of the samples."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.encoders import node_monitor
from drivers.encoders.cia406 import Cia406Bank
from drivers.errors import InvalidSampleError, RestartedNodeError, SilentNodeError

NO_MAGNET = bytes.fromhex("00ff210000000000")
CLEARED = bytes(8)
PERIOD_S = 0.02


async def test_an_emergency_makes_samples_invalid_until_it_is_cleared(raw, bank):
    await bank.open()
    raw.send(0x83, NO_MAGNET)
    await raw.delivered_to(bank)
    for _ in range(2):
        with pytest.raises(
            InvalidSampleError, match=r"leg 3 \(node 3\): reports emergency FF00 \(no magnet"
        ):
            await bank.read()
    raw.send(0x83, CLEARED)
    await raw.delivered_to(bank)
    await bank.read()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("3081110000000000", "8130 .its heartbeat monitoring tripped, error register 0x11"),
        ("0042090000000000", "4200 .temperature"),
        ("0000200000000000", "0000 .*error register 0x20"),  # one error gone, another is left
        ("00ff", "FF00 .no magnet, error register 0xff"),
        ("", "emergency FFFF"),
    ],
)
async def test_whatever_is_no_clean_reset_is_an_error(raw, bank, data, words):
    await bank.open()
    raw.send(0x81, bytes.fromhex(data))
    await raw.delivered_to(bank)
    with pytest.raises(InvalidSampleError, match=rf"leg 1 .*{words}"):
        await bank.read()


async def test_an_emergency_amid_a_round_spoils_that_round(raw, bank):
    await bank.open()

    def report_then_answer(_sync):
        raw.send(0x86, NO_MAGNET)
        return [bytes(4)]

    raw.nodes[6].answers_sync = report_then_answer
    with pytest.raises(InvalidSampleError, match=r"leg 6"):
        await bank.read()


async def test_after_an_emergency_the_alarms_are_looked_at(raw, bank, monkeypatch):
    monkeypatch.setattr("drivers.encoders.node_monitor.ALARM_POLL_S", 60.0)
    for node in raw.nodes.values():
        node.objects[0x6503, 0] = bytes(2)
    await bank.open()
    raw.nodes[3].objects[0x6503, 0] = b"\x01\x00"
    await bank.read()  # nobody has said so, and the last look is recent
    raw.send(0x83, NO_MAGNET)
    raw.send(0x83, CLEARED)
    await raw.delivered_to(bank)
    with pytest.raises(InvalidSampleError, match=r"leg 3 .*6503h:0 is 0x0001"):
        await bank.read()
    raw.nodes[3].objects[0x6503, 0] = bytes(2)
    await bank.read()


async def test_alarms_without_an_emergency_are_found_out(raw, bank, monkeypatch):
    monkeypatch.setattr("drivers.encoders.node_monitor.ALARM_POLL_S", 0.0)
    for node in raw.nodes.values():
        node.objects[0x6503, 0] = bytes(2)
    await bank.open()
    await bank.read()
    raw.nodes[5].objects[0x6503, 0] = b"\x00\x10"
    with pytest.raises(InvalidSampleError, match=r"leg 5 .*0x1000"):
        await bank.read()


async def test_a_boot_up_voids_the_set_until_opened_again(raw, bank):
    await bank.open()
    raw.send(0x702, b"\x00")
    await raw.delivered_to(bank)
    for _ in range(2):
        with pytest.raises(RestartedNodeError, match=r"leg 2 \(node 2\).*the set is void"):
            await bank.read()
    await bank.open()
    await bank.read()


async def test_a_boot_up_ends_a_round_that_waits(raw, settings):
    bank = Cia406Bank(settings.model_copy(update={"timeout_s": 10.0}))
    await bank.open()
    raw.nodes[2].answers_sync = lambda _: raw.send(0x702, b"\x00") or []
    with pytest.raises(RestartedNodeError):
        await bank.read()
    await bank.close()


async def test_a_boot_up_while_being_configured_is_noticed(raw, bank):
    answer = raw.nodes[2].answer_sdo

    def reboot_once(request):
        if request[:3] == b"\x2f\x01\x18":
            raw.send(0x702, b"\x00")
        return answer(request)

    raw.nodes[2].answer_sdo = reboot_once
    with pytest.raises(RestartedNodeError, match=r"leg 2"):
        await bank.open()


@pytest.mark.parametrize("state", [b"\x7f", b"\x04", b"\x00"])
async def test_a_node_that_leaves_operational_has_lost_its_configuration(raw, bank, state):
    await bank.open()
    raw.send(0x704, b"\x05")
    await raw.delivered_to(bank)
    await bank.read()
    raw.send(0x704, state)
    await raw.delivered_to(bank)
    with pytest.raises(RestartedNodeError, match=r"leg 4"):
        await bank.read()


class Hearts:
    """Heartbeats of the nodes in ``beating``, on a clock of the driver's that nothing else moves."""

    def __init__(self, raw: Any) -> None:
        self.beating = set(raw.nodes)
        self._raw = raw
        self._now_s = 1000.0

    def monotonic(self) -> float:
        return self._now_s

    async def go_on(self, bank: Any, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self._now_s += PERIOD_S
            for node in self.beating:
                self._raw.send(0x700 + node, bytes([self._raw.nodes[node].state]))
            if self.beating:
                await self._raw.delivered_to(bank)


@pytest.fixture
def hearts(raw, monkeypatch):
    beating = Hearts(raw)
    monkeypatch.setattr(node_monitor, "time", beating)
    return beating


@pytest.fixture
async def watchful(settings):
    bank = Cia406Bank(settings.model_copy(update={"heartbeat_ms": 20}))
    yield bank
    await bank.close()


async def test_heartbeats_are_asked_for_and_their_loss_is_an_error(raw, watchful, hearts):
    await watchful.open()
    assert raw.nodes[1].objects[0x1017, 0] == b"\x14\x00"
    await hearts.go_on(watchful, 0.4)
    await watchful.read()
    hearts.beating.discard(5)
    await hearts.go_on(watchful, 0.24)
    await watchful.read()
    await hearts.go_on(watchful, 0.04)
    with pytest.raises(SilentNodeError, match=r"encoder of leg 5 \(node 5\): no heartbeat for 0.26 s"):
        await watchful.read()


async def test_loss_of_all_heartbeats_points_at_the_bus(watchful, hearts):
    await watchful.open()
    await hearts.go_on(watchful, 0.1)
    hearts.beating.clear()
    await hearts.go_on(watchful, 0.3)
    with pytest.raises(SilentNodeError, match=r"leg 1 .*leg 6 .*CAN adapter"):
        await watchful.read()


async def test_without_heartbeats_silence_is_no_fault(bank, hearts):
    await bank.open()
    hearts.beating.clear()
    await hearts.go_on(bank, 3600.0 * PERIOD_S)
    await bank.read()
