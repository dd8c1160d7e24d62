"""Six encoders on a CAN bus that is paced by bits, with arbitration, in simulated time.

It takes the place of python-can's, below the whole driver. Its time passes with the bits of the frames, and
while the driver works: by the processor time of this process, less that of the simulation. What the driver
does while frames are on the wire costs nothing, as in real time; other work on the machine does not count.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import can
import pytest

from drivers.encoders import bank as plausibility
from drivers.encoders import can_bus, node_monitor
from drivers.encoders import node_monitor as alarm_poll
from tests.drivers.encoders import conftest

OPERATIONAL = 0x05
NODES = range(1, 7)
COUNTS = tuple(1000 * node for node in NODES)


def frame_bits(data_bytes: int) -> int:
    """The bits of a standard frame and of the space after it, with as many stuff bits as there may be."""
    stuffed = 34 + 8 * data_bytes
    return stuffed + (stuffed - 1) // 4 + 13


ROUND_BITS = frame_bits(0) + 6 * frame_bits(4)
"""A SYNC and six positions."""


class BusTime:
    """What stands in for the module ``time`` in the driver."""

    def __init__(self) -> None:
        self._waited_s = -time.process_time()
        self._not_the_driver_s = 0.0

    def monotonic(self) -> float:
        return self._waited_s - self._not_the_driver_s + time.process_time()

    time = monotonic

    def wait_until(self, due_s: float) -> None:
        self._waited_s += max(0.0, due_s - self.monotonic())

    @contextmanager
    def simulating(self) -> Iterator[None]:
        """What this thread does within does not count."""
        begun = time.thread_time()
        try:
            yield
        finally:
            self._not_the_driver_s += time.thread_time() - begun


@dataclass(frozen=True)
class Pending:
    """A frame that waits for the bus from ``ready_s`` on."""

    ready_s: float
    can_id: int
    data: bytes
    is_from_driver: bool


class PacedBus:
    """A bus with six encoders, and the driver as the other participant.

    When nobody has sent for ``patience_s`` in real time, the time of the bus passes by ``idle_s``.

    Attributes:
        syncs: how many SYNCs were on the bus.
        busy_s: how long there was a frame on it.
        unplugged: the nodes that are not on the bus.
    """

    def __init__(
        self, bitrate: int, heartbeat_s: float, idle_s: float = 0.2, patience_s: float = 0.2
    ) -> None:
        self.bitrate = bitrate
        self.unplugged: set[int] = set()
        self._idle_s, self._patience_s = idle_s, patience_s
        self.time = BusTime()
        self.syncs = 0
        self.busy_s = 0.0
        self.nodes = {
            node: conftest.RawNode(node, _objects(node), counts=counts)
            for node, counts in zip(NODES, COUNTS, strict=True)
        }
        self._heartbeat_s = heartbeat_s
        self._next_heartbeat_s = heartbeat_s
        self._free_s = 0.0
        self._pending: list[Pending] = []
        self._sent = threading.Condition()

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Be the bus that python-can opens, and the time of the driver."""
        monkeypatch.setattr(can, "Bus", lambda **_: self)
        for module in (alarm_poll, can_bus, node_monitor, plausibility):
            monkeypatch.setattr(module, "time", self.time)

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        del timeout
        with self.time.simulating(), self._sent:
            self._put(
                self.time.monotonic(), message.arbitration_id, bytes(message.data), is_from_driver=True
            )
            self._sent.notify()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        del timeout
        with self.time.simulating(), self._sent:
            if not self._pending and not self._sent.wait(self._patience_s):
                self.time.wait_until(self.time.monotonic() + self._idle_s)
            self._put_heartbeats()
            while self._pending:
                frame = self._transmit()
                if not frame.is_from_driver:
                    self.time.wait_until(self._free_s)
                    return can.Message(
                        arbitration_id=frame.can_id, data=frame.data, is_extended_id=False, is_rx=True
                    )
        return None

    def shutdown(self) -> None:
        with self._sent:
            self._pending.clear()

    def say(self, can_id: int, data: bytes) -> None:
        """Have a node send something by itself."""
        with self._sent:
            self._put(self.time.monotonic(), can_id, data)
            self._sent.notify()

    @property
    def _on_the_bus(self) -> dict[int, conftest.RawNode]:
        return {number: node for number, node in self.nodes.items() if number not in self.unplugged}

    def _put(self, ready_s: float, can_id: int, data: bytes, *, is_from_driver: bool = False) -> None:
        self._pending.append(Pending(ready_s, can_id, data, is_from_driver))

    def _transmit(self) -> Pending:
        """The frame that wins the bus when it is free: that with the lowest id."""
        begun_s = max(self._free_s, min(frame.ready_s for frame in self._pending))
        winner = min((one for one in self._pending if one.ready_s <= begun_s), key=lambda one: one.can_id)
        self._pending.remove(winner)
        taken_s = frame_bits(len(winner.data)) / self.bitrate
        self._free_s = begun_s + taken_s
        self.busy_s += taken_s
        if winner.is_from_driver:
            self._react(winner)
        return winner

    def _react(self, frame: Pending) -> None:
        if frame.can_id == conftest.SYNC:
            self.syncs += 1
            for node in self._on_the_bus.values():
                for data in node.positions(self.syncs) if node.state == OPERATIONAL else ():
                    self._put(self._free_s, node.tpdo, data)
        elif frame.can_id == conftest.NMT and frame.data[1] in self._on_the_bus:
            self.nodes[frame.data[1]].state = {1: OPERATIONAL, 0x80: 0x7F}[frame.data[0]]
        elif frame.can_id - conftest.SDO_REQUEST in self._on_the_bus and frame.data[0] != 0x80:
            node = self.nodes[frame.can_id - conftest.SDO_REQUEST]
            self._put(self._free_s, conftest.SDO_ANSWER + node.node, node.answer_sdo(frame.data))

    def _put_heartbeats(self) -> None:
        while self._next_heartbeat_s <= self.time.monotonic():
            for node in self._on_the_bus.values():
                self._put(self._next_heartbeat_s, conftest.HEARTBEAT + node.node, bytes((node.state,)))
            self._next_heartbeat_s += self._heartbeat_s


def _objects(node: int) -> dict[tuple[int, int], bytes]:
    """Those of a node with an error register, alarms and warnings, which are read again and again."""
    return {**conftest.plain_objects(node), (0x1001, 0): b"\0", (0x6503, 0): b"\0\0", (0x6505, 0): b"\0\0"}
