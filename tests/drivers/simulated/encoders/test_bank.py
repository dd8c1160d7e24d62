"""Simulated encoders: seen on the wire without the driver, and by the real one over pty and socket."""

import asyncio
from functools import partial

import pytest

from drivers.errors import BusError
from drivers.simulated.encoders.object_dictionary import EVENTS_AND_SYNC
from drivers.simulated.serial_line import PtyLine, SocketLine
from drivers.simulated.slcan import SlcanServer
from hexacell.clock import CellClock
from tests.drivers.simulated.encoders.conftest import EVENTS_ONLY, TWO_MAGNETS
from tests.waiting import until


async def test_rounds_are_complete_and_of_one_instant(make_bank, reach, driver, samples):
    simulated = make_bank(vendors=(EVENTS_AND_SYNC, EVENTS_ONLY, TWO_MAGNETS) * 2)
    bank = driver(reach(simulated))
    await bank.open()
    before = samples.taken
    rounds = [(await bank.read()).counts for _ in range(100)]
    assert rounds == [(count,) * 6 for count in range(before + 1, before + 101)]


@pytest.mark.parametrize(
    "changes",
    [
        {"nodes": (11, 25, 3, 127, 64, 1)},
        {"direction": (1, -1, 1, -1, 1, -1), "offset": (500.0, -500.0, 0.0, 1.5, -2.25, 1000.0)},
        {"measuring_step_nm": 5000.0},
        {"signed": False, "offset": (-1000.0,) * 6},
        {"serial_numbers": (9, 8, 7, 6, 5, 4)},
    ],
)
async def test_positions_come_back_within_half_a_step(make_bank, driver, settings, changes):
    positions = (-430.12345, 12.0, 0.0004, 399.9996, -0.0015, 733.7)
    changed = settings.model_copy(update=changes)
    simulated = make_bank(settings=changed, positions=lambda: positions)
    bank = driver(simulated.bus_settings, **changes)
    await bank.open()
    found = (await bank.read()).positions
    assert found == pytest.approx(positions, abs=changed.measuring_step_nm * 0.5e-6 + 1e-9)


@pytest.mark.parametrize("line", [partial(PtyLine, "slcan"), SocketLine], ids=["pty", "socket"])
@pytest.mark.parametrize("reading", [True, False])
async def test_an_adapter_that_is_closed(make_bank, driver, samples, line, reading):
    simulated = make_bank()
    adapter = SlcanServer(simulated.channel, line())
    bank = driver(adapter.bus_settings, timeout_s=2.0)
    await bank.open()
    if reading:
        simulated.faults(1)["silent"](on=True)
        before = samples.taken
        waiting = asyncio.ensure_future(bank.read())
        await until(lambda: samples.taken > before)
        adapter.close()
    else:
        adapter.close()
        waiting = asyncio.ensure_future(bank.read())
    with pytest.raises(BusError, match=r"encoder bus slcan .*CAN adapter"):
        await waiting


START, STOP, PRE_OPERATIONAL, RESET, RESET_COMMUNICATION = 1, 2, 0x80, 0x81, 0x82
SYNC, NMT = 0x80, 0


@pytest.mark.parametrize("command", [STOP, PRE_OPERATIONAL, RESET, RESET_COMMUNICATION])
def test_positions_are_sent_only_while_operational(make_bank, listen, command):
    ear = listen(make_bank())
    ear.send(NMT, START, 3)
    ear.send(SYNC)
    ear.wait_for(0x283)
    ear.send(NMT, command, 3)
    ear.heard()
    ear.send(SYNC)
    assert ear.heard() == []


def test_a_reset_restores_the_vendors_defaults(make_bank, listen):
    clock = CellClock()
    ear = listen(make_bank(clock=clock))
    begun_s = clock.now()
    assert ear.sdo(1, "2b17100032") == "6017100000000000"
    assert {ear.next() for _ in range(4)} == {(0x701, "7f")}
    assert clock.now() - begun_s >= 4 * 0.05
    ear.send(NMT, RESET, 1)
    assert ear.wait_for(0x701) in ("7f", "00")
    ear.heard()
    assert ear.silence()
    assert ear.sdo(1, "40171000") == "4b17100000000000"


@pytest.mark.parametrize(
    ("before", "request_", "code"),
    [
        ([], "2300180182010000", 0x06090030),  # another COB-ID while the PDO is on
        ([], "2f001a0000", 0x08000022),  # mapping while the PDO is on
        (["2300180181010080"], "23001a0120000460", 0x08000022),  # an entry while the mapping is valid
        ([], "2300100000000000", 0x06010002),  # the device type
    ],
)
def test_changes_of_pdos_against_the_rules_are_refused(make_bank, listen, before, request_, code):
    ear = listen(make_bank())
    for each in before:
        assert ear.sdo(1, each).startswith("60")
    answer = ear.sdo(1, request_)
    assert answer[:2] == "80"
    assert int.from_bytes(bytes.fromhex(answer[8:]), "little") == code
