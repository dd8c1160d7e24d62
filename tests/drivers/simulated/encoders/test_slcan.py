"""The slcan adapter: its ASCII protocol, and python-can's own slcan against it."""

import os
import uuid
from functools import partial

import can
import pytest
import serial

from drivers.simulated.serial_line import PtyLine, SocketLine
from drivers.simulated.slcan import SlcanAdapter, SlcanServer, decode_frame


@pytest.mark.parametrize(
    "text", ["t800", "t8000", "t1819", "t18120A", "t18120AFF0", "T200000000", "r18120AFF"]
)
def test_faulty_frames_are_refused(text):
    assert decode_frame(text) is None


@pytest.fixture
def adapter():
    sent: list[can.Message] = []
    adapter = SlcanAdapter(sent.append)
    return adapter, sent


def test_frames_pass_only_while_the_channel_is_open(adapter):
    device, sent = adapter
    assert device.answer("t0800") == b"\a"
    assert device.answer("O") == b"\r"
    assert device.answer("t0800") == b"z\r"
    assert device.answer("T000000800") == b"Z\r"
    assert device.answer("C") == b"\r"
    assert device.answer("t0800") == b"\a"
    assert [message.arbitration_id for message in sent] == [0x80, 0x80]


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("S6", b"\r"),
        ("s031C", b"\r"),
        ("", b"\r"),
        ("Z0", b"\r"),
        ("V", b"V1013\r"),
        ("N", b"NHX01\r"),
        ("F", b"F00\r"),
        ("S", b"\a"),
        ("S66", b"\a"),
        ("nonsense", b"\a"),
        ("\ufffd", b"\a"),
    ],
)
def test_commands_and_their_answers(adapter, command, answer):
    assert adapter[0].answer(command) == answer


@pytest.fixture(params=[partial(PtyLine, "slcan"), SocketLine], ids=["pty", "socket"])
def pair(request):
    """A virtual bus, and the same through an adapter."""
    channel = f"slcan-{uuid.uuid4().hex}"
    with (
        can.Bus(channel, interface="virtual") as near,
        SlcanServer(channel, request.param()) as server,
        can.Bus(**server.bus_settings) as far,
    ):
        far.send(can.Message(is_extended_id=False))
        assert near.recv(10.0) is not None  # the adapter has opened its channel
        yield near, far


def test_frames_pass_both_ways(pair):
    near, far = pair
    frames = [
        can.Message(arbitration_id=0x80, is_extended_id=False),
        can.Message(arbitration_id=0x7FF, data=bytes(range(8)), is_extended_id=False),
        can.Message(arbitration_id=0x1FFFFFFF, data=b"\xff" * 8),
    ]
    for source, sink in ((near, far), (far, near)):
        for frame in frames:
            source.send(frame)
        for frame in frames:
            found = sink.recv(10.0)
            assert found is not None
            assert found.equals(frame, timestamp_delta=None, check_channel=False, check_direction=False)


def test_the_server_continues_after_garbage():
    channel = f"slcan-{uuid.uuid4().hex}"
    with can.Bus(channel, interface="virtual") as near, SlcanServer(channel, PtyLine("slcan")) as server:
        line = os.open(server.bus_settings["channel"], os.O_RDWR | os.O_NOCTTY)
        os.write(line, bytes(range(256)) * 4)
        os.write(line, b"\rO\rt0800\r")
        found = near.recv(10.0)
        os.close(line)
    assert found is not None
    assert found.arbitration_id == 0x80


def exchanged(server: SlcanServer, command: bytes) -> bytes:
    """The answer to a command of a client that connects for it alone."""
    with serial.serial_for_url(server.bus_settings["channel"], timeout=10.0) as client:
        client.write(command)
        return client.read()


def test_a_client_that_connects_finds_the_channel_closed():
    with SlcanServer(f"slcan-{uuid.uuid4().hex}", SocketLine()) as server:
        assert exchanged(server, b"O\r") == b"\r"
        assert exchanged(server, b"t0800\r") == b"\a"
        assert exchanged(server, b"O\rt08") == b"\r"
        assert exchanged(server, b"S6\r") == b"\r"
