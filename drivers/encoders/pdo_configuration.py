"""Configuration of a node: one TPDO with its position at every SYNC, no other TPDO, and a heartbeat.

Requires PRE-OPERATIONAL. Nothing is stored in the device: a power cycle restores its settings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.encoders.canopen_node import EncoderNode, setting_refused
from drivers.encoders.object_dictionary import (
    POSITION,
    POSITION_OF_MAGNET_1,
    PRODUCER_HEARTBEAT,
    TPDO_COUNT,
    DeviceType,
    ObjectEntry,
    tpdo_cob_id,
    tpdo_event_timer,
    tpdo_mapping,
    tpdo_transmission_type,
)

WITH_EVERY_SYNC = 1
_OFF = 1 << 31
_NO_RTR = 1 << 30
_POSITION_BITS = 32


@dataclass(frozen=True, slots=True)
class Tpdo:
    """A transmit PDO as configured in the device.

    A mapping parameter is made of index, subindex and length (CiA 301), the length in the lowest byte.
    """

    number: int
    cob_id: int
    transmission_type: int
    mapping: tuple[int, ...]

    @property
    def position_offset(self) -> int | None:
        """The offset of the position in its data, bits; none if it is not mapped."""
        positions = (_mapping_parameter(POSITION), _mapping_parameter(POSITION_OF_MAGNET_1))
        bits = 0
        for parameter in self.mapping:
            if parameter in positions:
                return bits
            bits += parameter & 0xFF
        return None


@dataclass(frozen=True, slots=True)
class PositionChannel:
    """Where a leg's position comes from: a CAN id, and four bytes from ``first`` on."""

    cob_id: int
    first: int

    @property
    def length(self) -> int:
        """Shortest frame that holds the position, bytes."""
        return self.first + _POSITION_BITS // 8

    def counts(self, data: bytes, *, signed: bool) -> int:
        """The position in a frame, counts."""
        return int.from_bytes(data[self.first : self.length], "little", signed=signed)


def configure_position_tpdo(node: EncoderNode, kind: DeviceType, heartbeat_ms: int) -> PositionChannel:
    """Set one TPDO to the position with every SYNC, switch the others off, start the heartbeat."""
    tpdos = [tpdo for number in range(1, TPDO_COUNT + 1) if (tpdo := _read(node, number)) is not None]
    if not tpdos:
        raise setting_refused("has no transmit PDO", node.leg)
    selected = _select(tpdos)
    for tpdo in tpdos:
        node.write(tpdo_cob_id(tpdo.number), tpdo.cob_id | _OFF)
    channel = _set_up(node, selected, kind)
    if heartbeat_ms or node.read_optional(PRODUCER_HEARTBEAT):
        node.write(PRODUCER_HEARTBEAT, heartbeat_ms)
    return channel


def _read(node: EncoderNode, number: int) -> Tpdo | None:
    cob_id = node.read_optional(tpdo_cob_id(number))
    if cob_id is None:
        return None
    slots = range(1, node.read(tpdo_mapping(number, 0)) + 1)
    return Tpdo(
        number,
        cob_id,
        node.read(tpdo_transmission_type(number)),
        tuple(node.read(tpdo_mapping(number, slot)) for slot in slots),
    )


def _select(tpdos: Sequence[Tpdo]) -> Tpdo:
    """The TPDO that needs the fewest changes: position mapped, synchronous, lowest number."""
    return min(
        tpdos,
        key=lambda tpdo: (tpdo.position_offset is None, tpdo.transmission_type > 240, tpdo.number),
    )


def _set_up(node: EncoderNode, tpdo: Tpdo, kind: DeviceType) -> PositionChannel:
    offset = tpdo.position_offset
    if offset is None:
        _map_only(node, tpdo.number, kind.position)
        offset = 0
    if offset % 8:
        raise setting_refused(f"has its position {offset} bits into TPDO {tpdo.number}", node.leg)
    node.write(tpdo_transmission_type(tpdo.number), WITH_EVERY_SYNC)
    if node.read_optional(tpdo_event_timer(tpdo.number)):
        node.write(tpdo_event_timer(tpdo.number), 0)
    cob_id = 0x80 + 0x100 * tpdo.number + node.leg.node
    node.write(tpdo_cob_id(tpdo.number), cob_id | tpdo.cob_id & _NO_RTR)
    _verify(node, tpdo.number)
    return PositionChannel(cob_id, offset // 8)


def _map_only(node: EncoderNode, number: int, position: ObjectEntry) -> None:
    node.write(tpdo_mapping(number, 0), 0)
    node.write(tpdo_mapping(number, 1), _mapping_parameter(position))
    node.write(tpdo_mapping(number, 0), 1)


def _verify(node: EncoderNode, number: int) -> None:
    """Read back: some devices acknowledge a write without effect."""
    if node.read(tpdo_transmission_type(number)) != WITH_EVERY_SYNC:
        raise setting_refused(f"acknowledges, but does not keep, TPDO {number} with every SYNC", node.leg)
    if node.read(tpdo_cob_id(number)) & _OFF:
        raise setting_refused(f"acknowledges, but does not do, switching TPDO {number} on", node.leg)


def _mapping_parameter(position: ObjectEntry) -> int:
    return position.index << 16 | position.subindex << 8 | _POSITION_BITS
