"""An encoder written frame by frame, without canopen, so that a dialogue can be exactly wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

SYNC, NMT, EMERGENCY, SDO_ANSWER, SDO_REQUEST, HEARTBEAT = 0x80, 0x00, 0x80, 0x580, 0x600, 0x700
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
