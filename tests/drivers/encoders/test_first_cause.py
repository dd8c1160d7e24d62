"""A message of silent or jumping encoders names the cause that is known, and advice that fits to it."""

import threading
from contextlib import closing, nullcontext
from typing import Any
from unittest.mock import Mock

import can
import pytest

from drivers.encoders.can_bus import EncoderBus
from drivers.errors import BusError, InvalidSampleError, SilentNodeError
from hexacell.errors import DeviceError
from tests.drivers.encoders.conftest import short_timeout


@pytest.mark.parametrize(
    ("nodes", "told"),
    [
        ((4,), r"^encoder of leg 4 \(node 4\): no .*the others answer\. Check its supply and cable,"),
        ((2, 4), r"^encoders of leg 2 .* leg 4 .*the others answer"),
        (range(1, 7), r"leg 1 .* leg 6 .*no encoder answers\. Check the CAN adapter, supply and"),
    ],
)
async def test_all_that_are_silent_are_told_and_whether_others_answer(raw, make_bank, nodes, told):
    bank = make_bank(timeout_s=1.0)
    await bank.open()
    bank._session._nodes[0].sdo.timeout_s = 0.1
    for node in nodes:
        raw.nodes[node].answers_sync, raw.nodes[node].answers_sdo = (lambda _: []), 0
    with short_timeout(bank), pytest.raises(SilentNodeError, match=told):
        await bank.read()


@pytest.mark.parametrize("left", [1, 0])
async def test_a_bus_without_a_node_is_not_told_as_six_cables(raw, make_bank, left):
    for node in range(1 + left, 7):
        del raw.nodes[node]
    told = "Check supply, cable and" if left else "Check the CAN adapter, .*bit rate and node id"
    with pytest.raises(BusError, match=told):
        await make_bank(timeout_s=0.3).open()


@pytest.mark.parametrize("kind", ["short", "heartbeat"])
async def test_a_node_that_sends_but_does_not_answer_is_told_so(raw, make_bank, kind):
    answer = raw.nodes[3].answer_sdo
    raw.nodes[3].answer_sdo = lambda request: answer(request)[:5]
    if kind == "heartbeat":
        raw.nodes[3].answer_sdo = lambda request: raw.send(0x703, b"\x7f") or b""
    with pytest.raises(BusError, match=r"leg 3 .*sends, but no answer of eight.*Try again"):
        await make_bank(timeout_s=0.3).open()


async def test_a_node_whose_heartbeat_says_that_it_does_not_start_is_told_so(raw, make_bank):
    react = raw._react

    def refuse(can_id, data):
        raw.send(0x703, b"\x7f") if (can_id, data) == (0, b"\1\3") else react(can_id, data)

    raw._react = refuse
    with pytest.raises(SilentNodeError, match=r"leg 3 .*by its heartbeat it did not start\. Read why"):
        await make_bank(timeout_s=0.3).open()


async def test_encoders_that_could_not_be_opened_say_why(raw, make_bank):
    del raw.nodes[3]
    bank = make_bank(timeout_s=0.3)
    for call, error in ((bank.open, BusError), (bank.read, DeviceError)):
        with pytest.raises(error, match=r"leg 3 \(node 3\): no device responds\. Check supply, cable and"):
            await call()


@pytest.mark.parametrize(("change", "told"), [(-(2**24), "24 bits that.*preset"), (9**7, "See what")])
async def test_a_count_that_begins_anew_is_no_weak_magnet(raw, make_bank, change, told):
    bank = make_bank(largest_speed=1.0)
    await bank.open()
    await bank.read()
    raw.nodes[3].counts += change
    with pytest.raises(InvalidSampleError, match=rf"leg 3 .*jumped .*{told}"):
        await bank.read()


BUSES = [
    ({"interface": "nope", "channel": 0}, "Unknown interface .*Correct `bus`"),
    ({"interface": "slcan"}, "Correct `bus`"),
    ({"interface": "slcan", "channel": "loop://", "bitrate": 123}, "Invalid bitrate.*Correct `bus`"),
    ({"interface": "slcan", "channel": "/dev/null"}, "ioctl.*Correct `bus`"),
    ({"interface": "slcan", "channel": "/"}, "Is a directory.*Correct `bus`"),
    ({"interface": "slcan", "channel": ""}, "serial port"),
    ({"interface": "slcan", "channel": "/dev/no-tty"}, "^encoder bus slcan /dev/no-tty: .*Plug the"),
    ({"interface": "slcan", "channel": "socket://127.0.0.1:1"}, "refused.* Start the adapter's server"),
    (OSError("pcanbasic library not found."), "Install its maker's library"),
    (PermissionError(13, "Permission denied"), "Give this user the right"),
    (OSError(13, "Access denied (insufficient permissions)"), "Give this user the right"),
    (OSError(16, "Device or resource busy"), "or ModemManager"),
    (OSError(11, "Could not exclusively lock port"), "or ModemManager"),
    (OSError(97, "Address family not supported by protocol"), "modprobe"),
    (OSError(19, "No such device"), "Plug the CAN adapter in"),
]


@pytest.mark.parametrize(("bus", "told"), BUSES)
def test_why_an_adapter_cannot_be_opened_is_told(monkeypatch, bus, told):
    if isinstance(bus, Exception):
        monkeypatch.setattr(can, "Bus", Mock(side_effect=bus))
    with pytest.raises(BusError, match=told):
        EncoderBus(bus if isinstance(bus, dict) else {}, threading.Event())


@pytest.mark.parametrize("stays", [False, True])
def test_a_full_queue_of_the_kernel_is_waited_for(raw, monkeypatch, stays):
    """It holds ten frames, where a search sends one to each of 127 nodes."""
    full = can.CanOperationError("Failed to transmit: No buffer space available", 105)
    with closing(EncoderBus({"interface": "virtual", "channel": raw.channel}, threading.Event())) as bus:
        port: Any = bus.network.bus
        send, asked = port.send, []

        def once_in_a_while(message, timeout=None):
            asked.append(message)
            if stays or len(asked) % 11 == 0:
                raise full
            send(message, timeout)

        monkeypatch.setattr(port, "send", once_in_a_while)
        with pytest.raises(BusError, match=r"buffer.*termination") if stays else nullcontext():
            bus.network.scanner.search()
            assert bus.wait_for(lambda: len(bus.network.scanner.nodes) == 6, 5.0)


async def test_frames_of_others_show_that_the_bit_rate_is_right(raw, make_bank):
    raw._react = lambda *_: raw.send(0x1F0, is_extended_id=True)
    with pytest.raises(BusError, match=r"others send\. Check supply, cable and node id"):
        await make_bank(timeout_s=0.3).open()


DAMAGED = can.CanOperationError("Could not read: can't decode byte 0xff")
DAMAGED.__cause__ = ValueError()


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        (can.Message(is_error_frame=True, arbitration_id=0x20), "nobody acknowledges.*bit rate"),
        (can.Message(is_error_frame=True, arbitration_id=0x40), "gave up .*bus off"),
        (ValueError("non-hexadecimal number found"), "no frame .*End other programs that read this port"),
        (IndexError("of a line that was cut"), "no frame .*End other programs that read this port"),
        (DAMAGED, "no frame .*can't decode.*End other programs that read this port"),
        (can.CanOperationError("Network is down"), "Switch the CAN interface on"),
        (
            can.CanOperationError("returned no data (multiple access on port?)"),
            "Plug the CAN .*other program",
        ),
        (OSError(19, "No such device"), "Check the CAN adapter, its cable"),
    ],
)
async def test_what_the_adapter_reports_is_told(raw, opened, monkeypatch, fault, told):
    def recv(_timeout_s):
        if isinstance(fault, Exception):
            raise fault
        return fault

    bus: EncoderBus = opened._session.bus
    monkeypatch.setattr(bus.network.bus, "recv", recv)
    bus._receiver.join()
    with pytest.raises(BusError, match=told):
        await opened.read()
