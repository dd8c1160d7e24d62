"""What a simulated encoder does on the wire, seen without the driver."""

import pytest

from hexacell.clock import CellClock

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
