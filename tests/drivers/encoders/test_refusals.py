"""Only the codes that mean absence make an entry absent; any other refusal is asked again, then told."""

from unittest.mock import Mock

import can
import pytest
from can.interfaces.virtual import VirtualBus

from drivers.discovery import SearchTimeouts
from drivers.discovery.encoders import search_bus
from drivers.encoders import canopen_node
from drivers.errors import TIMES_ASKED, InvalidSampleError
from hexacell.errors import DeviceError

NOT_NOW, HARDWARE, NO_SUBINDEX = 0x0800_0022, 0x0606_0000, 0x0609_0011
ALARMS, REGISTER, STEP, OTHER_STEP = (0x6503, 0), (0x1001, 0), (0x6005, 1), (0x6501, 0)
WRITE, READ = 1, 2
QUICK = SearchTimeouts(adapter=1.0, node=0.1, listen=0.0)
SYNC_ID, HEARTBEAT, SERIAL = (0x1005, 0), (0x1017, 0), (0x1018, 4)


@pytest.fixture(autouse=True)
def without_a_pause(monkeypatch):
    monkeypatch.setattr(canopen_node, "PAUSE_S", 0.0)


def refusing(node, key, code, times=1000, service=READ):
    """Have a node refuse an entry, for some times; what it was asked then."""
    answer, asked = node.answer_sdo, []

    def refuse(request):
        if request[0] >> 5 == service and request[1:4] == key[0].to_bytes(2, "little") + bytes([key[1]]):
            asked.append(request)
            if len(asked) <= times:
                return b"\x80" + request[1:4] + code.to_bytes(4, "little")
        return answer(request)

    node.answer_sdo = refuse
    return asked


@pytest.mark.parametrize("key", [ALARMS, REGISTER])
async def test_an_alarm_that_is_not_told_at_once_is_told_when_asked_again(raw, bank, key):
    raw.nodes[3].objects[key] = b"\x01\0"[: 2 if key == ALARMS else 1]
    refusing(raw.nodes[3], key, NOT_NOW, times=1)
    with pytest.raises(InvalidSampleError, match=rf"leg 3 .*has an alarm \(object {key[0]:04X}h:0"):
        await bank.open()


async def test_a_step_that_is_not_told_at_once_is_compared_all_the_same(raw, bank):
    raw.nodes[3].objects |= {STEP: (5000).to_bytes(4, "little"), OTHER_STEP: (1000).to_bytes(4, "little")}
    refusing(raw.nodes[3], STEP, NOT_NOW, times=2)
    with pytest.raises(DeviceError, match=r"leg 3 .*two measuring steps: 5000 nm"):
        await bank.open()


@pytest.mark.parametrize("code", [HARDWARE, NOT_NOW, 0x0504_0000, 0x0800_0000, 0x0BAD_C0DE])
@pytest.mark.parametrize("key", [ALARMS, (0x1000, 0), SERIAL, (0x1802, 1), HEARTBEAT, SYNC_ID])
async def test_what_stays_refused_is_an_error_with_object_and_code(raw, bank, key, code):
    asked = refusing(raw.nodes[5], key, code)
    told = rf"leg 5 \(node 5\).*refuses 4 times to read object {key[0]:04X}h:{key[1]}: Code 0x{code:08X}"
    with pytest.raises(DeviceError, match=told):
        await bank.open()
    assert len(asked) == TIMES_ASKED + (key == (0x1000, 0))  # and the probe


async def test_a_missing_subindex_is_absence_and_asked_once(raw, bank):
    asked = refusing(raw.nodes[2], (0x1018, 2), NO_SUBINDEX)
    await bank.open()
    assert len(asked) == 1


async def test_a_setting_that_is_refused_for_the_moment_is_written_again(raw, bank):
    asked = refusing(raw.nodes[4], (0x1801, 2), NOT_NOW, times=1, service=WRITE)
    await bank.open()
    assert len(asked) == 2


@pytest.mark.parametrize("setting", [0x90, 0x4000_0080, 0x4000_0090, 0x2000_0080])
async def test_a_node_that_waits_for_another_sync_is_set_to_this_one(raw, bank, setting):
    raw.nodes[6].objects[SYNC_ID] = setting.to_bytes(4, "little")
    await bank.open()
    assert raw.nodes[6].objects[SYNC_ID] == (0x80).to_bytes(4, "little")


@pytest.mark.parametrize("is_sized", [True, False])
async def test_bytes_beyond_a_short_value_are_no_part_of_it(raw, bank, is_sized):
    def answer_with_junk(request, answer=raw.nodes[1].answer_sdo):
        reply = answer(request)
        if reply[0] >> 5 == 2 and (length := 4 - (reply[0] >> 2 & 3)) < 4:
            return bytes([reply[0] if is_sized else 0x42]) + reply[1 : 4 + length] + b"\xa5" * (4 - length)
        return reply

    raw.nodes[1].objects |= {ALARMS: bytes(2), REGISTER: bytes(1)}
    raw.nodes[1].answer_sdo = answer_with_junk
    await bank.open()
    assert (await bank.read()).counts[0] == 1000


def test_a_search_tells_the_nodes_beside_one_that_refuses(raw):
    refusing(raw.nodes[4], (0x1000, 0), HARDWARE)
    found = search_bus({"interface": "virtual", "channel": raw.channel}, QUICK)
    assert [one.node for one in found.nodes] == [1, 2, 3, 4, 5, 6]
    assert "it refuses 4 times to read object 1000h:0: Code 0x06060000" in found.nodes[3].description
    assert found.nodes[3].unit is None


def test_a_search_tells_what_the_failure_of_its_bus_says(raw, monkeypatch):
    bus, down = {"interface": "virtual", "channel": raw.channel}, can.CanOperationError("Network is down")
    monkeypatch.setattr(VirtualBus, "send", Mock(side_effect=down))
    assert "Switch the CAN interface on" in search_bus(bus, QUICK).problem
