"""Frames on a CAN bus that are of no CANopen node: of encoders that a DBC file describes, perhaps."""

from __future__ import annotations

import threading
from collections.abc import Collection
from dataclasses import dataclass

import can

from drivers.encoders.can_bus import is_canopen

MAX_IDENTIFIERS = 64
"""So many are kept: a vehicle's bus has some hundreds."""

OF_A_NODE = (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)
"""Identifiers that a node adds its id to (CiA 301, predefined connection set)."""

OF_ALL_NODES = (0x000, 0x080, 0x100)
"""NMT, SYNC and TIME."""


@dataclass(frozen=True, slots=True)
class FoundFrame:
    """The frames with one identifier.

    Attributes:
        length: of the latest, bytes.
        per_second: how many came.
        changes: whether their data were not always the same.
    """

    identifier: int
    is_extended: bool
    length: int
    per_second: float
    changes: bool


@dataclass(slots=True)
class _Heard:
    latest: bytes
    count: int = 0
    changes: bool = False


class OverheardFrames:
    """What a bus says while it is only listened to: a filter of an :class:`EncoderBus`, which keeps it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._heard: dict[tuple[int, bool], _Heard] = {}

    def accepts(self, message: can.Message) -> bool:
        """Keep a frame; whether it is one for a CANopen network."""
        if message.is_rx and not message.is_remote_frame:
            with self._lock:
                self._keep(message)
        return is_canopen(message)

    def counted(self, seconds: float) -> tuple[FoundFrame, ...]:
        """Those that were heard until now, in ``seconds``, by identifier."""
        with self._lock:
            return tuple(
                FoundFrame(number, is_extended, len(one.latest), one.count / seconds, one.changes)
                for (number, is_extended), one in sorted(self._heard.items())
            )

    def _keep(self, message: can.Message) -> None:
        key, data = (message.arbitration_id, message.is_extended_id), bytes(message.data)
        if key not in self._heard and len(self._heard) == MAX_IDENTIFIERS:
            return
        one = self._heard.setdefault(key, _Heard(data))
        one.changes = one.changes or data != one.latest
        one.latest, one.count = data, one.count + 1


def of_no_node(frames: Collection[FoundFrame], nodes: Collection[int]) -> tuple[FoundFrame, ...]:
    """The frames that are not of these CANopen nodes."""
    known = {service + node for service in OF_A_NODE for node in nodes}
    known |= set(OF_ALL_NODES if nodes else ())
    return tuple(one for one in frames if one.is_extended or one.identifier not in known)
