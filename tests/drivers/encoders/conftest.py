"""Six raw nodes on a bus, and banks that use it."""

import threading
import uuid
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import can
import pytest

from drivers.encoders.cia406 import Cia406Bank
from hexacell.cell.devices import LinearEncoderSettings
from tests.waiting import until

SYNC, NMT, SDO_ANSWER, SDO_REQUEST, HEARTBEAT = 0x80, 0x00, 0x580, 0x600, 0x700
NOT_THERE = 0x0602_0000
Object = tuple[int, int]


@dataclass
class RawNode:
    """A node as a table of its objects; hooks replace what it answers."""

    node: int
    objects: dict[Object, bytes]
    counts: int = 0
    answers_sdo: int = 1
    answers_sync: Callable[[int], list[bytes]] | None = None
    refuses: dict[Object, int] = field(default_factory=dict)
    forgets: set[Object] = field(default_factory=set)
    state: int = 0x7F

    @property
    def tpdo(self) -> int:
        """The COB-ID of the TPDO in use."""
        return int.from_bytes(self.objects[0x1801, 1], "little") & 0x7FF

    def answer_sdo(self, request: bytes) -> bytes:
        """One expedited transfer."""
        key = (int.from_bytes(request[1:3], "little"), request[3])
        if request[0] >> 5 == 2:
            return self._upload(request, key)
        if key in self.refuses:
            return _abort(request, self.refuses[key])
        if key not in self.objects:
            return _abort(request, NOT_THERE)
        size = 4 - (request[0] >> 2 & 3)
        if key not in self.forgets:
            self.objects[key] = bytes(request[4 : 4 + size])
        return b"\x60" + request[1:4] + bytes(4)

    def positions(self, sync: int) -> list[bytes]:
        """What it sends at a SYNC."""
        if self.answers_sync is not None:
            return self.answers_sync(sync)
        return [self.counts.to_bytes(4, "little", signed=True)]

    def _upload(self, request: bytes, key: Object) -> bytes:
        if key not in self.objects:
            return _abort(request, NOT_THERE)
        data = self.objects[key]
        return bytes([0x43 | (4 - len(data)) << 2]) + request[1:4] + data.ljust(4, b"\0")


def _abort(request: bytes, code: int) -> bytes:
    return b"\x80" + request[1:4] + code.to_bytes(4, "little")


def plain_objects(node: int) -> dict[Object, bytes]:
    """An absolute linear encoder of 1 um that has TPDO2 with SYNC, and hardly more."""

    def unsigned(value: int, size: int = 4) -> bytes:
        return value.to_bytes(size, "little")

    return {
        (0x1000, 0): unsigned(0x0008_0196),
        (0x1017, 0): unsigned(0, 2),
        (0x1018, 1): unsigned(0x99),
        (0x1018, 4): unsigned(500 + node),
        (0x6005, 1): unsigned(1000),
        (0x1800, 1): unsigned(0x180 + node),
        (0x1800, 2): unsigned(254, 1),
        (0x1A00, 0): unsigned(0, 1),
        (0x1801, 1): unsigned(0x280 + node),
        (0x1801, 2): unsigned(1, 1),
        (0x1A01, 0): unsigned(1, 1),
        (0x1A01, 1): unsigned(0x6004_0020),
    }


LSS_REQUEST, LSS_ANSWER = 0x7E5, 0x7E4
SWITCH_GLOBAL, CONFIGURE_NODE_ID = 0x04, 0x11
RESET_ALL = bytes((0x82, 0))
MARKER = 0x7F0
"""An identifier that no node uses."""


@dataclass
class LayerSetting:
    """How all devices in configuration state answer LSS requests (CiA 305).

    ``nameless`` are devices without a node id, which answer nothing else; ``refusal`` is the error code
    of an id that is not taken; ``forgets`` it at the reset.
    """

    nameless: int = 0
    is_known: bool = True
    refusal: int = 0
    forgets: bool = False
    is_configuring: bool = False
    node: int | None = None

    def answers(self, data: bytes, named: int) -> list[bytes]:
        """Of each device that is meant."""
        if data[0] == SWITCH_GLOBAL:
            self.is_configuring = data[1] == 1
        if data[0] == SWITCH_GLOBAL or not (self.is_configuring and self.is_known):
            return []
        if data[0] == CONFIGURE_NODE_ID and not self.refusal:
            self.node = data[1]
        code = self.refusal if data[0] == CONFIGURE_NODE_ID else 0
        return [bytes((data[0], code)) + bytes(6)] * (named + self.nameless)

    def renamed(self, nodes: dict[int, RawNode]) -> dict[int, RawNode]:
        """The nodes after a reset."""
        if self.node is None or self.forgets:
            return nodes
        [one] = nodes.values() or [RawNode(self.node, plain_objects(self.node))]
        one.node = self.node
        return {self.node: one}


class RawBus:
    """Six raw nodes on a virtual bus; ``heard`` is what the driver sent."""

    def __init__(self) -> None:
        self.channel = f"raw-{uuid.uuid4().hex}"
        self.nodes = {node: RawNode(node, plain_objects(node), counts=1000 * node) for node in range(1, 7)}
        self.heard: list[tuple[int, bytes]] = []
        self.syncs = 0
        self.synced = threading.Event()
        self.layer_setting = LayerSetting()
        self._bus = can.Bus(self.channel, interface="virtual")
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def send(self, can_id: int, data: bytes = b"", **kind: Any) -> None:
        """Put any frame on the bus."""
        self._bus.send(can.Message(arbitration_id=can_id, data=data, **{"is_extended_id": False} | kind))

    async def delivered_to(self, bank: Cia406Bank) -> None:
        """Return when the driver has received all that was sent so far: frames keep their order."""
        assert bank._session is not None
        received, network = threading.Event(), bank._session.bus.network
        network.subscribe(MARKER, lambda *_frame: received.set())
        self.send(MARKER)
        await until(received.is_set)
        network.unsubscribe(MARKER)

    def requests_to(self, node: int) -> list[str]:
        """SDO requests and NMT commands that a node got, in hexadecimal."""
        return [
            data.hex()
            for can_id, data in self.heard
            if can_id == SDO_REQUEST + node or (can_id == NMT and data[1] == node)
        ]

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._bus.shutdown()

    def _run(self) -> None:
        while not self._stop.is_set():
            message = self._bus.recv(0.01)
            if message is not None:
                self.heard.append((message.arbitration_id, bytes(message.data)))
                self._react(message.arbitration_id, bytes(message.data))

    def _react(self, can_id: int, data: bytes) -> None:
        if can_id == SYNC:
            self._sync()
        elif can_id == LSS_REQUEST:
            for answer in self.layer_setting.answers(data, len(self.nodes)):
                self.send(LSS_ANSWER, answer)
        elif can_id == NMT and data == RESET_ALL:
            self.nodes = self.layer_setting.renamed(self.nodes)
        elif can_id == NMT and data[1] in self.nodes:
            self.nodes[data[1]].state = {1: 0x05, 0x80: 0x7F}[data[0]]
        elif can_id - SDO_REQUEST in self.nodes:
            node = self.nodes[can_id - SDO_REQUEST]
            if data[0] != 0x80:
                for _ in range(node.answers_sdo):
                    self.send(SDO_ANSWER + node.node, node.answer_sdo(data))

    def _sync(self) -> None:
        self.syncs += 1
        for node in self.nodes.values():
            for data in node.positions(self.syncs) if node.state == 0x05 else ():
                self.send(node.tpdo, data)
        self.synced.set()


@pytest.fixture
def raw() -> Iterator[RawBus]:
    bus = RawBus()
    yield bus
    bus.close()


@pytest.fixture
def settings(raw: RawBus) -> LinearEncoderSettings:
    """Raw nodes send no heartbeat unless a test does."""
    return LinearEncoderSettings(
        bus={"interface": "virtual", "channel": raw.channel}, heartbeat_ms=0, timeout_s=10.0
    )


@pytest.fixture
async def make_bank(settings: LinearEncoderSettings) -> AsyncIterator[Callable[..., Cia406Bank]]:
    """A bank with other settings than these."""
    made = []

    def make(trace: Any = None, **changes: Any) -> Cia406Bank:
        made.append(Cia406Bank(settings.model_copy(update=changes), trace=trace))
        return made[-1]

    yield make
    for bank in made:
        await bank.close()


@pytest.fixture
def bank(make_bank: Callable[..., Cia406Bank]) -> Cia406Bank:
    return make_bank()


@pytest.fixture
async def opened(bank: Cia406Bank) -> Cia406Bank:
    await bank.open()
    return bank


@pytest.fixture
def short_timeout_bank(make_bank: Callable[..., Cia406Bank]) -> Cia406Bank:
    """A bank for tests in which a node is silent."""
    return make_bank(timeout_s=1.0)


@contextmanager
def short_timeout(bank: Cia406Bank, timeout_s: float = 0.1) -> Iterator[None]:
    assert bank._session is not None
    sampler = bank._session._sampler
    before, sampler.timeout_s = sampler.timeout_s, timeout_s
    yield
    sampler.timeout_s = before
