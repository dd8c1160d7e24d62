"""Sampling: one SYNC, and one position of each leg, all of the same instant.

A node is configured for that in PRE-OPERATIONAL: one TPDO with its position at every SYNC, no other TPDO.
Nothing is stored in the device: a power cycle restores its settings. Positions are never
read over SDO: some devices respond with an older sample.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.encoders import object_dictionary as od
from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode, Leg, duplicated_node, setting_refused, silent_nodes
from drivers.encoders.object_dictionary import DeviceType, ObjectEntry
from drivers.errors import BusError

SYNC = 0x080
MAX_SYNCS = 3
LATE_RESPONSE_TIMEOUTS = 3
"""How long to listen after a sample that may contain a late response, in time-outs."""

WITH_EVERY_SYNC = 1
_OFF = 1 << 31
_NO_RTR = 1 << 30
_POSITION_BITS = 32
_SENDS_SYNC = 1 << 30
_SYNC_SETTING = (1 << 31) - 1  # bit 31 means nothing


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
        """The offset of the position in its data, bits; None if it is not mapped."""
        positions = (_mapping_parameter(od.POSITION), _mapping_parameter(od.POSITION_OF_MAGNET_1))
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


def configure_position_tpdo(node: EncoderNode, kind: DeviceType) -> PositionChannel:
    """Set one TPDO to the position with every SYNC, and switch the others off."""
    tpdos = [tpdo for number in range(1, od.TPDO_COUNT + 1) if (tpdo := _read(node, number)) is not None]
    if not tpdos:
        raise setting_refused("has no transmit PDO", node.leg)
    # The TPDO that needs the fewest changes: position mapped, synchronous, lowest number.
    selected = min(
        tpdos, key=lambda one: (one.position_offset is None, one.transmission_type > 240, one.number)
    )
    for tpdo in tpdos:
        node.write(od.tpdo_parameter(tpdo.number, od.COB_ID), tpdo.cob_id | _OFF)
    return _set_up(node, selected, kind)


def follow_plain_sync(node: EncoderNode) -> None:
    """Have a node wait for the SYNC of this program, of the usual identifier and without a counter."""
    setting = node.read_optional(od.SYNC_ID)
    if setting is not None and setting & _SYNC_SETTING != SYNC:
        if setting & _SENDS_SYNC:  # it takes no other identifier while it sends (CiA 301)
            node.write(od.SYNC_ID, setting & ~_SENDS_SYNC)
        node.write(od.SYNC_ID, SYNC)
        if node.read(od.SYNC_ID) & _SYNC_SETTING != SYNC:
            raise setting_refused(f"acknowledges, but does not keep, {od.SYNC_ID} of {SYNC:#x}", node.leg)
    if node.read_optional(od.SYNC_COUNTER):
        node.write(od.SYNC_COUNTER, 0)


def _read(node: EncoderNode, number: int) -> Tpdo | None:
    if (cob_id := node.read_optional(od.tpdo_parameter(number, od.COB_ID))) is None:
        return None
    slots = range(1, node.read(od.tpdo_mapping(number, 0)) + 1)
    return Tpdo(
        number,
        cob_id,
        node.read(od.tpdo_parameter(number, od.TRANSMISSION_TYPE)),
        tuple(node.read(od.tpdo_mapping(number, slot)) for slot in slots),
    )


def _set_up(node: EncoderNode, tpdo: Tpdo, kind: DeviceType) -> PositionChannel:
    if (offset := tpdo.position_offset) is None:
        node.write(od.tpdo_mapping(tpdo.number, 0), 0)
        node.write(od.tpdo_mapping(tpdo.number, 1), _mapping_parameter(kind.position))
        node.write(od.tpdo_mapping(tpdo.number, 0), 1)
        offset = 0
    if offset % 8:
        raise setting_refused(f"has its position {offset} bits into TPDO {tpdo.number}", node.leg)
    node.write(od.tpdo_parameter(tpdo.number, od.TRANSMISSION_TYPE), WITH_EVERY_SYNC)
    if node.read_optional(od.tpdo_parameter(tpdo.number, od.EVENT_TIMER)):
        node.write(od.tpdo_parameter(tpdo.number, od.EVENT_TIMER), 0)
    cob_id = 0x80 + 0x100 * tpdo.number + node.leg.node
    node.write(od.tpdo_parameter(tpdo.number, od.COB_ID), cob_id | tpdo.cob_id & _NO_RTR)
    # Read back: some devices acknowledge a write without effect.
    if node.read(od.tpdo_parameter(tpdo.number, od.TRANSMISSION_TYPE)) != WITH_EVERY_SYNC:
        what = f"acknowledges, but does not keep, TPDO {tpdo.number} with every SYNC"
        raise setting_refused(what, node.leg)
    if node.read(od.tpdo_parameter(tpdo.number, od.COB_ID)) & _OFF:
        raise setting_refused(f"acknowledges, but does not do, switching TPDO {tpdo.number} on", node.leg)
    return PositionChannel(cob_id, offset // 8)


def _mapping_parameter(position: ObjectEntry) -> int:
    return position.index << 16 | position.subindex << 8 | _POSITION_BITS


@dataclass(eq=False)
class SyncSampler:
    """Sends SYNC and counts responses: no leg may respond more often than there were SYNCs.

    A late response would be taken for that to the next SYNC, and the six positions would not be of
    one instant. After an incomplete sample, therefore, the missing responses are awaited once more
    before the next SYNC. Those that do not come are written off; the next sample then counts only if
    no response follows it: failed SYNCs follow each other within two time-outs, and a leg that lags
    behind responds at the same rate.

    A position is decoded as it comes, while others are on the wire: what is done after the last one is a
    tenth of a round on a fast bus.
    """

    legs: Sequence[Leg]
    channels: Sequence[PositionChannel]
    bus: EncoderBus
    timeout_s: float
    signed: bool
    _other_master: str = ""

    def __post_init__(self) -> None:
        self._outstanding = [0] * len(self.legs)
        self._counts: list[int | None] = [None] * len(self.legs)
        self._lengths = [0] * len(self.legs)
        self._index = {channel.cob_id: index for index, channel in enumerate(self.channels)}
        for channel in self.channels:
            self.bus.network.subscribe(channel.cob_id, self._on_position)
        for can_id in (SYNC, od.NMT):
            self.bus.network.subscribe(can_id, self._on_other_master)

    def sample(self) -> tuple[int, ...]:
        """One complete sample, the counts of all legs, after at most ``MAX_SYNCS`` SYNCs.

        It is valid if :meth:`EncoderBus.check` finds nothing before it and after it: a surplus response
        from before would pass for one to its SYNC.
        """
        for _ in range(MAX_SYNCS):
            is_synchronized = self._is_complete() or self.bus.wait_for(self._is_complete, self.timeout_s)
            with self.bus.condition:
                # Late responses that do not come are written off; each leg owes one to this SYNC.
                self._outstanding = [min(outstanding, 0) + 1 for outstanding in self._outstanding]
            self.bus.network.send_message(SYNC, b"")
            if not self.bus.wait_for(self._is_complete, self.timeout_s):
                continue
            if not is_synchronized:
                self.bus.listen(LATE_RESPONSE_TIMEOUTS * self.timeout_s)
            return self._received()
        silent = [leg for leg, left in zip(self.legs, self._outstanding, strict=True) if left > 0]
        raise silent_nodes(f"no response to SYNC within {self.timeout_s:g} s, {MAX_SYNCS} times", silent)

    def check(self) -> None:
        """Raise if a leg sent more positions than there were SYNCs, or another master commands them."""
        if min(self._outstanding) < 0:
            leg = self.legs[self._outstanding.index(min(self._outstanding))]
            raise duplicated_node("sent more positions than there were SYNCs", leg)
        if self._other_master:
            raise BusError(
                f"another master sends {self._other_master} on it, or its adapter echoes what is sent",
                subject=self.bus.name,
                action="Give the encoders a bus of their own, or switch the other master off",
            )

    def _is_complete(self) -> bool:
        return max(self._outstanding) <= 0

    def _received(self) -> tuple[int, ...]:
        counts = tuple(count for count in self._counts if count is not None)
        if len(counts) < len(self._counts):
            index = self._counts.index(None)
            raise self.legs[index].error(
                f"sent {self._lengths[index]} bytes where its position needs {self.channels[index].length}",
                "Try again; if it stays so, use another device",
            )
        return counts

    def _on_position(self, can_id: int, data: bytearray, _timestamp: float) -> None:
        index = self._index[can_id]
        channel = self.channels[index]
        is_whole = len(data) >= channel.length
        self._lengths[index] = len(data)
        self._counts[index] = channel.counts(bytes(data), signed=self.signed) if is_whole else None
        self._outstanding[index] -= 1
        if self._is_complete():
            self.bus.condition.notify_all()

    def _on_other_master(self, can_id: int, data: bytearray, _timestamp: float) -> None:
        ours = {0, *(leg.node for leg in self.legs)}
        if can_id == SYNC or (data[:1] != bytes([od.NmtCommand.START]) and ours & {*data[1:2]}):
            self._other_master = "SYNC" if can_id == SYNC else "NMT commands that stop encoders"
