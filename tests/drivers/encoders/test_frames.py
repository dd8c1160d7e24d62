"""Discovery on a CAN bus: frames of strangers are told, and the node id of the only device is set."""

import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.discovery import SearchTimeouts, encoders
from drivers.discovery.encoders import (
    MAX_IDENTIFIERS,
    FoundFrame,
    OverheardFrames,
    frames_of_no_node,
    search_bus,
)
from drivers.encoders.can_bus import EncoderBus
from drivers.errors import BusError
from drivers.simulated import slcan
from drivers.simulated.encoders.can_bus import PeriodicAction, SimulatedCanBus
from drivers.simulated.serial_line import PtyLine
from hexacell.errors import DeviceError
from tests.drivers.encoders.conftest import LSS_REQUEST

QUICK = SearchTimeouts(adapter=1.0, node=0.1, listen=0.3)
STRANGER, EXTENDED = 0x321, 0x18FF0001
NODE_IDS = st.sets(st.integers(1, 127), max_size=6)


def frame(number: int, data: bytes = b"\1", **kind: bool) -> can.Message:
    return can.Message(arbitration_id=number, data=data, **{"is_extended_id": False} | kind)


def test_frames_are_counted_by_identifier_and_changes_of_their_data_are_seen() -> None:
    overheard = OverheardFrames()
    for data in (b"\1\2", b"\1\2", b"\1\2", b"\1\3"):
        overheard.accepts(frame(0x202, data))
        overheard.accepts(frame(0x201, data[:1]))
    overheard.accepts(frame(0x201, is_extended_id=True))
    assert overheard.counted(2.0) == (
        FoundFrame(0x201, False, 1, 2.0, changes=False),
        FoundFrame(0x201, True, 1, 0.5, changes=False),
        FoundFrame(0x202, False, 2, 2.0, changes=True),
    )


def test_what_was_sent_or_is_empty_is_not_counted_nor_more_than_fits() -> None:
    overheard = OverheardFrames()
    assert not overheard.accepts(frame(0x201, is_rx=False))
    assert not overheard.accepts(can.Message(arbitration_id=0x201, is_remote_frame=True))
    assert overheard.counted(1.0) == ()
    overheard = OverheardFrames()
    for number in range(2 * MAX_IDENTIFIERS):
        overheard.accepts(frame(number))
    assert len(overheard.counted(1.0)) == MAX_IDENTIFIERS


@given(nodes=NODE_IDS, service=st.sampled_from([0x80, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700]))
def test_no_frame_of_a_node_is_told(nodes: set[int], service: int) -> None:
    frames = [FoundFrame(service + node, False, 4, 1.0, changes=False) for node in range(1, 128)]
    told = {one.identifier - service for one in frames_of_no_node(frames, nodes)}
    assert told == set(range(1, 128)) - nodes


@contextmanager
def sending(channel: str, *messages: can.Message) -> Iterator[None]:
    """A device that sends these again and again."""
    bus = SimulatedCanBus(channel)

    def send() -> None:
        assert bus.bus is not None
        for message in messages:
            bus.bus.send(message)

    PeriodicAction(bus, 0.005, send)
    bus.start()
    try:
        yield
    finally:
        bus.close()


def test_a_stranger_among_nodes_or_another_bit_rate_is_told(raw) -> None:
    strange = (frame(STRANGER, b"\1\2\3"), frame(EXTENDED, bytes(8), is_extended_id=True))
    with sending(raw.channel, *strange, frame(0x701, b"\5"), frame(0x80, b"")):
        found = search_bus({"interface": "virtual", "channel": raw.channel}, QUICK)
    assert [node.node for node in found.nodes] == [1, 2, 3, 4, 5, 6]
    told = [(one.identifier, one.is_extended, one.length) for one in found.frames]
    assert told == [(STRANGER, False, 3), (EXTENDED, True, 8)]
    assert all(one.per_second > 0 for one in found.frames)
    channel = "another-bit-rate"
    with sending(channel, can.Message(is_error_frame=True)):
        found = search_bus({"interface": "virtual", "channel": channel}, QUICK)
    assert "error frames within 1 s" in found.problem
    assert "try another bit rate" in found.problem


class CanableAdapter(slcan.SlcanAdapter):
    """Acknowledges nothing, and takes a lone line end for the command before."""

    version, latest = b"", ""

    def answer(self, command: str) -> bytes:
        self.latest = command or self.latest
        return self.version + b"\r" if self.latest == "V" else b""


ADAPTERS = (
    b"b158aa7 github.com/x/canable2-fw.git",
    b"0c1d2e3f4-dirty git@x.org:y",
    b"CANtact 1",
    b"\aV0100",
    b"V1013\r\n",
)


@pytest.mark.parametrize("version", [*ADAPTERS, b"error:20", b"Unknown command: V"])
async def test_adapters_of_other_makers_are_found(raw, monkeypatch, version) -> None:
    monkeypatch.setattr(slcan, "SlcanAdapter", CanableAdapter)
    monkeypatch.setattr(CanableAdapter, "version", version)
    with closing(slcan.SlcanServer(raw.channel, PtyLine("adapter"))) as server:
        found = encoders.speaks_slcan(server.bus_settings["channel"], QUICK)
    assert found is (version in ADAPTERS)


@pytest.mark.parametrize("number", [0x000, 0x080, 0x100])
def test_frames_of_all_nodes_are_told_only_where_there_are_none(number: int) -> None:
    one = FoundFrame(number, False, 0, 1.0, changes=False)
    assert frames_of_no_node([one], []) == (one,)
    assert frames_of_no_node([one], [5]) == ()


@pytest.mark.parametrize("line", [b"%s\r\n", b"\n%s\n", b"z%s\r", b"Z\r\n\a%s\r"])
def test_frames_are_seen_with_any_line_end_and_after_a_late_acknowledgement(line: bytes) -> None:
    adapter = {"interface": "slcan", "channel": "loop://", "sleep_after_open": 0}
    with closing(EncoderBus(adapter, threading.Event())) as bus:
        received: list[bytes] = []
        bus.network.subscribe(0x181, lambda _number, data, _time: received.append(bytes(data)))
        port: Any = bus._bus
        port.serialPortOrig.write(line % b"t18121234" * 2)
        assert bus.wait_for(lambda: received == [b"\x12\x34"] * 2, 5.0)


set_node_id = partial(encoders.set_node_id, timeouts=SearchTimeouts(adapter=0.3, node=0.1))


@pytest.fixture
def bus(raw):
    return {"interface": "virtual", "channel": raw.channel}


@pytest.fixture
def alone(raw):
    raw.nodes = {3: raw.nodes[3]}
    return raw


def test_the_only_device_takes_the_id_and_answers_with_it(alone, bus) -> None:
    assert set_node_id(bus, 5) == 3
    assert list(alone.nodes) == [5]
    assert not alone.layer_setting.is_configuring
    requests = [data[0] for can_id, data in alone.heard if can_id == LSS_REQUEST]
    assert requests == [0x04, 0x5A, 0x11, 0x17, 0x04]


def test_a_device_without_an_id_gets_one(raw, bus) -> None:
    raw.nodes, raw.layer_setting.nameless = {}, 1
    assert set_node_id(bus, 7) is None
    assert list(raw.nodes) == [7]


def test_nothing_is_set_where_there_are_several(raw, bus) -> None:
    with pytest.raises(DeviceError, match=r"has several nodes: 1, 2, 3, 4, 5, 6\. Connect the one device"):
        set_node_id(bus, 9)
    assert not any(can_id == LSS_REQUEST for can_id, _ in raw.heard)


def test_one_without_an_id_beside_it_is_counted(alone, bus) -> None:
    alone.layer_setting.nameless = 1
    with pytest.raises(DeviceError, match=r"has 2 devices that answer\. Connect the one device"):
        set_node_id(bus, 5)
    assert list(alone.nodes) == [3]
    assert alone.layer_setting.node is None
    assert not alone.layer_setting.is_configuring


@pytest.mark.parametrize("is_there", [True, False])
def test_what_does_not_know_the_protocol_is_told(alone, bus, is_there: bool) -> None:
    alone.layer_setting.is_known = False
    if not is_there:
        alone.nodes = {}
    with pytest.raises(DeviceError, match="has no device that knows LSS: "):
        set_node_id(bus, 5)


def test_an_id_that_is_refused_is_told_and_the_device_works_on(alone, bus) -> None:
    alone.layer_setting.refusal = 1
    with pytest.raises(DeviceError, match="has a device that refuses node id 5: "):
        set_node_id(bus, 5)
    assert not alone.layer_setting.is_configuring


def test_an_id_that_does_not_hold_is_told(alone, bus) -> None:
    alone.layer_setting.forgets = True
    with pytest.raises(BusError, match="has no node 5 after it was stored"):
        set_node_id(bus, 5)
