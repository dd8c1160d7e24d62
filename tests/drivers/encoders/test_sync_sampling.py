"""Sampling: six positions of one SYNC, or an error."""

import asyncio
import math
import threading
from contextlib import nullcontext

import pytest

from drivers.encoders.cia406 import Cia406Bank
from drivers.encoders.sync_sampling import MAX_SYNCS
from drivers.errors import BusError, InvalidSampleError, SilentNodeError, WrongSetting
from hexacell.errors import DeviceError
from tests.drivers.encoders.conftest import short_timeout
from tests.waiting import until


def counts(value: int) -> bytes:
    return value.to_bytes(4, "little", signed=True)


async def test_a_sample_is_one_sync_and_no_sdo_request(raw, opened):
    raw.heard.clear()
    assert (await opened.read()).counts == (1000, 2000, 3000, 4000, 5000, 6000)
    assert raw.heard == [(0x80, b"")]


async def test_counts_become_millimetres_by_direction_step_and_offset(raw, settings):
    for leg, value in enumerate((0, 1, -1, 2**31 - 1, -(2**31), 400), 1):
        raw.nodes[leg].counts = value
        raw.nodes[leg].objects[0x6005, 1] = (250).to_bytes(4, "little")
    bank = Cia406Bank(
        settings.model_copy(
            update={
                "measuring_step_nm": 250.0,
                "direction": (1, -1, 1, -1, 1, -1),
                "offset": (7.5, 0.0, -1.0, 0.0, 0.0, 100.0),
            }
        )
    )
    await bank.open()
    found = await bank.read()
    await bank.close()
    assert found.counts == (0, 1, -1, 2**31 - 1, -(2**31), 400)
    expected = (7.5, -0.00025, -1.00025, -536870.91175, -536870.912, 99.9)
    assert found.positions == pytest.approx(expected, abs=1e-9)


async def test_unsigned_positions_do_not_turn_negative(raw, make_bank):
    bank = make_bank(signed=False)
    await bank.open()
    raw.nodes[1].counts = 2**31 - 1
    assert (await bank.read()).counts[0] == 2**31 - 1
    raw.nodes[1].counts = -1
    with pytest.raises(WrongSetting, match=r"leg 1.*shows 4294967295 counts.*signed = true"):
        await bank.read()


@pytest.mark.parametrize("jump_counts", [400_000, -400_000])
async def test_a_joint_that_jumps_farther_than_it_can_go_is_an_error(raw, make_bank, jump_counts):
    bank = make_bank(largest_speed=1e-3)
    await bank.open()
    await bank.read()
    raw.nodes[3].counts += 900  # less than a millimetre, which is no jump
    await bank.read()
    raw.nodes[3].counts += jump_counts
    with pytest.raises(InvalidSampleError, match=r"leg 3 .*jumped from 3.900 to -?\d+\.[19]00 mm in"):
        await bank.read()


async def test_an_incomplete_sample_is_discarded_and_repeated(raw, opened):
    for node in raw.nodes.values():
        node.answers_sync = lambda sync, node=node: (
            [] if (sync, node.node) == (2, 3) else [counts(100 * sync + node.node)]
        )
    with short_timeout(opened):
        found = (await opened.read()).counts
    sync = found[0] // 100
    assert sync >= 3, "more were needed where this machine was busy"
    assert found == tuple(100 * sync + node for node in range(1, 7))


async def test_a_silent_leg_is_named_after_bounded_tries(raw, opened):
    raw.nodes[5].answers_sync = lambda _: []
    before = raw.syncs
    told = r"leg 5 \(node 5\): no response to SYNC.*SDO requests are answered.*its supply for a dip"
    silent = pytest.raises(SilentNodeError, match=told)
    with short_timeout(opened), silent:
        await opened.read()
    assert raw.syncs - before == MAX_SYNCS


async def test_if_all_nodes_are_silent_the_error_suggests_the_bus(raw, opened):
    for node in raw.nodes.values():
        node.answers_sync = lambda _: []
    silent = pytest.raises(SilentNodeError, match=r"leg 1 .*leg 6 .*CAN adapter, supply and termination")
    with short_timeout(opened), silent:
        await opened.read()


async def test_a_late_response_is_awaited_before_the_next_sync(raw, opened, monkeypatch):
    assert opened._session is not None
    bus, timed_out = opened._session.bus, threading.Event()
    wait_for = bus.wait_for

    def first_times_out(ready, _timeout_s):
        """Whoever waits for the answers of SYNC 2 gives up at once, and then waits for ever."""
        if ready() or timed_out.is_set():
            return wait_for(ready, math.inf)
        timed_out.set()
        return wait_for(ready, 0.0)

    monkeypatch.setattr(bus, "wait_for", first_times_out)
    raw.nodes[2].answers_sync = lambda sync: [] if sync == 2 else [counts(77)]
    reading = asyncio.ensure_future(opened.read())
    await until(lambda: timed_out.is_set() and raw.syncs == 2)
    raw.send(raw.nodes[2].tpdo, counts(66))
    assert (await reading).counts[1] == 77
    assert raw.syncs == 3


async def test_a_surplus_position_never_passes_for_that_of_a_later_sync(raw, opened):
    await opened.read()
    raw.send(raw.nodes[4].tpdo, counts(77))
    await raw.delivered_to(opened)
    raw.nodes[4].answers_sync = lambda _sync: []
    for _ in range(2):
        with pytest.raises(DeviceError, match=r"leg 4 \(node 4\).*more positions than there were SYNCs"):
            await opened.read()


SENT = [(128, b"", "SYNC"), (0, b"\x80\0", "NMT"), (0, b"\2\3", "NMT"), (0, b"\2\7", ""), (0, b"\1\0", "")]


@pytest.mark.parametrize(("can_id", "data", "told"), SENT)
async def test_commands_of_another_master_to_encoders_are_an_error(raw, opened, can_id, data, told):
    raw.send(can_id, data)
    await raw.delivered_to(opened)
    with pytest.raises(BusError, match=f"another master sends {told}") if told else nullcontext():
        await opened.read()


@pytest.mark.parametrize("size", [0, 3])
async def test_a_frame_too_short_is_no_position(raw, opened, size):
    raw.nodes[6].answers_sync = lambda _: [bytes(size)]
    with pytest.raises(DeviceError, match=f"leg 6.*sent {size} bytes where its position needs 4"):
        await opened.read()


async def test_position_is_taken_from_where_it_is_mapped(raw, bank):
    objects = raw.nodes[1].objects
    objects[0x1A01, 0] = b"\x02"
    objects[0x1A01, 1] = bytes.fromhex("10013060")  # 16 bits of speed first
    objects[0x1A01, 2] = bytes.fromhex("20000460")
    raw.nodes[1].answers_sync = lambda _: [b"\xff\xff" + counts(-5)]
    await bank.open()
    assert (await bank.read()).counts[0] == -5


async def test_frames_that_are_not_canopen_are_ignored(raw, opened):
    cob_id = raw.nodes[1].tpdo
    raw.send(cob_id, counts(9), is_extended_id=True)
    raw.send(cob_id, is_remote_frame=True)
    raw.send(cob_id, counts(9), is_error_frame=True)
    raw.send(0x123, b"anything")
    raw.send(0x7E4, b"\0" * 8)
    await raw.delivered_to(opened)
    assert (await opened.read()).counts[0] == 1000


async def test_the_echo_of_its_own_sync_is_not_that_of_another_master(raw, settings, make_bank):
    echoing = {**settings.bus, "receive_own_messages": True}
    bank = make_bank(bus=echoing)
    await bank.open()
    await bank.read()
    await bank.read()
