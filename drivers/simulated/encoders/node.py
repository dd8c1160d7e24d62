"""One simulated encoder: canopen's local node with additions.

Added are boot-up, NMT gating, TPDOs with SYNC and on event timers, emergencies, and the rules of
CiA 301 for changing PDOs.
"""

import struct
from collections.abc import Callable, Iterator
from functools import partial

import canopen
from canopen.objectdictionary import ODVariable
from canopen.sdo.exceptions import SdoAbortedError

from drivers.simulated.encoders import object_dictionary
from drivers.simulated.encoders.can_bus import PeriodicAction, SimulatedCanBus
from drivers.simulated.encoders.object_dictionary import DeviceData, Vendor

_NMT = 0x000
_RESET_COMMANDS = (0x81, 0x82)
_SYNCHRONOUS = range(1, 241)
NO_MAGNET = 0xFF00
DIRTY_SCALE = 0x02
"""Bit of the warnings: the light of the scale is at its limit."""
POSITION_ERROR = 0x21
"""Error register: generic and device profile specific."""
WRONG_SYNC, COMMUNICATION_ERROR = 0x8240, 0x11
"""Emergency of a SYNC of unexpected length, and the error register with it."""
REVERSED = 1 << 3
COUNTER_OVERFLOW = 240

_NOT_NOW = 0x0800_0022
_WRONG_VALUE = 0x0609_0030


class SimulatedEncoder:
    """A device on the bus.

    Attributes:
        counts: the position of its last sample.
        is_silent: it responds to no SYNC, but to everything else.
        is_frozen: it sends the position of its last sample for ever.
        shift: so much more it counts, as after a lost revolution.
        is_doubled: it answers a SYNC twice, as where another device has the same node id.
    """

    def __init__(
        self, bus: SimulatedCanBus, vendor: Vendor, data: DeviceData, real_seconds: Callable[[float], float]
    ) -> None:
        self.data = data
        self.counts = 0
        self.is_silent = self.is_frozen = self.is_doubled = False
        self.shift = 0
        self._has_reported_sync = False
        self._bus = bus
        self._vendor = vendor
        self._real_seconds = real_seconds
        self._event_timers: list[PeriodicAction] = []
        self._syncs = 0
        self._node = canopen.LocalNode(data.node, object_dictionary.build(vendor, data))
        self._node.add_read_callback(self._read_position)  # type: ignore[no-untyped-call]
        self._node.add_write_callback(self._check_pdo_rules)  # type: ignore[no-untyped-call]

    @property
    def is_operational(self) -> bool:
        """Whether it may send PDOs."""
        return self._node.has_network() and self._node.nmt.state == "OPERATIONAL"

    def set_unplugged(self, *, on: bool) -> None:
        """Disconnect from the bus without a message, or connect and boot."""
        if on and self._node.has_network():
            self._node.nmt.stop_heartbeat()  # type: ignore[no-untyped-call]
            self._stop_event_timers()
            self._bus.unsubscribe(_NMT, self._on_nmt)
            self._node.remove_network()
        elif not on and not self._node.has_network():
            self._node.associate_network(self._bus)
            self._bus.subscribe(_NMT, self._on_nmt)
            self.boot()

    def set_object(self, index: int, form: str, faulty: int, sound: int = 0, *, on: bool) -> None:
        """Have a faulty value in an object, or a sound one; nothing is sent."""
        self._node.set_data(index, 0, struct.pack(form, faulty if on else sound))

    def set_zeroed(self, *, on: bool) -> None:
        """Press the preset: the present position becomes 0; what it did stays."""
        if on:
            self.shift -= self.counts
            self.set_object(object_dictionary.OFFSET, "<i", self.shift, on=True)

    def switch_on_again(self, *, on: bool) -> None:
        """Boot, as after a loss of its supply."""
        if on and self._node.has_network():
            self._stop_event_timers()
            self.boot()

    def sample(self, counts: int) -> None:
        if not self.is_frozen:
            is_reversed = self._value(object_dictionary.OPERATING_PARAMETERS, 0) & REVERSED
            self.counts = (-counts if is_reversed else counts) + self.shift

    def set_alarm(self, *, on: bool) -> None:
        """Report that there is no magnet, or that it is back, and set the error register."""
        code, register = (NO_MAGNET, POSITION_ERROR) if on else (0, 0)
        self.set_object(object_dictionary.ERROR_REGISTER, "B", register, on=True)
        self._send_emergency(code, register)

    def boot(self) -> None:
        """Boot with default settings: boot-up message, then PRE-OPERATIONAL."""
        self._node.nmt.stop_heartbeat()  # type: ignore[no-untyped-call]
        self._stop_event_timers()
        self._node.data_store.clear()
        self._syncs = 0
        self._node.nmt.state = "RESET"
        self._node.nmt.state = "PRE-OPERATIONAL"

    def on_sync(self) -> Iterator[tuple[int, bytes]]:
        """The frames (COB-ID, data) sent at this SYNC, with the present sample."""
        self._syncs += 1
        if not self.is_operational or self.is_silent or self._misses_counter():
            return
        for number in range(1, len(self._vendor.tpdos) + 1):
            transmission_type = self._value(0x1800 + number - 1, 2)
            if transmission_type in _SYNCHRONOUS and self._syncs % transmission_type == 0:
                for _ in range(1 + self.is_doubled):
                    yield from self._frames(number)

    def send(self, cob_id: int, data: bytes) -> None:
        """Send a PDO, if the node is operational."""
        if self.is_operational:
            self._bus.send_message(cob_id, data)

    def _send_emergency(self, code: int, register: int) -> None:
        self._bus.send_message(0x80 + self.data.node, struct.pack("<HB5x", code, register))

    def _misses_counter(self) -> bool:
        """Whether it wants a counter in the SYNC, which this bus never has; reported once."""
        if not self._value(object_dictionary.SYNC_COUNTER, 0):
            self._has_reported_sync = False
            return False
        if not self._has_reported_sync:
            self._has_reported_sync = True
            self._send_emergency(WRONG_SYNC, COMMUNICATION_ERROR)
        return True

    def _on_nmt(self, _can_id: int, data: bytearray, _timestamp: float) -> None:
        command, addressed = data[:2]
        if addressed not in (0, self.data.node):
            return
        if command in _RESET_COMMANDS:
            self.boot()
        self._stop_event_timers()
        for number in range(1, len(self._vendor.tpdos) + 1) if self.is_operational else ():
            is_on = not self._value(0x1800 + number - 1, 1) & object_dictionary.TPDO_OFF
            period_ms = self._value(0x1800 + number - 1, 5)
            if is_on and period_ms and self._value(0x1800 + number - 1, 2) not in _SYNCHRONOUS:
                period_s, send = self._real_seconds(period_ms / 1000), partial(self._send_tpdo, number)
                self._event_timers.append(PeriodicAction(self._bus, period_s, send))

    def _send_tpdo(self, number: int) -> None:
        for cob_id, data in self._frames(number):
            self.send(cob_id, data)

    def _frames(self, number: int) -> Iterator[tuple[int, bytes]]:
        cob_id = self._value(0x1800 + number - 1, 1)
        if not cob_id & object_dictionary.TPDO_OFF:
            mapping = 0x1A00 + number - 1
            slots = (self._value(mapping, slot) for slot in range(1, self._value(mapping, 0) + 1))
            data = b"".join(self._node.get_data(slot >> 16, slot >> 8 & 0xFF) for slot in slots)
            yield cob_id & 0x7FF, data

    def _value(self, index: int, subindex: int) -> int:
        return int.from_bytes(self._node.get_data(index, subindex), "little")

    def _stop_event_timers(self) -> None:
        for timer in self._event_timers:
            timer.stop()
        self._event_timers.clear()

    def _read_position(self, index: int, subindex: int, **_: object) -> int | None:
        is_position = index == object_dictionary.POSITION or (
            index == object_dictionary.POSITION_OF_MAGNET and subindex == 1
        )
        return self.counts if is_position else None

    def _check_pdo_rules(self, index: int, subindex: int, od: ODVariable, data: bytes) -> None:
        """CiA 301: PDOs are changed in PRE-OPERATIONAL, COB-ID and mapping only while off."""
        del od
        if 0x1800 <= index < 0x1C00 and self.is_operational:
            raise SdoAbortedError(_NOT_NOW)
        value = int.from_bytes(data, "little")
        if 0x1800 <= index < 0x1A00 and subindex == 1:
            old = self._value(index, 1)
            if not (old | value) & object_dictionary.TPDO_OFF and old != value:
                raise SdoAbortedError(_WRONG_VALUE)
        if 0x1A00 <= index < 0x1C00:
            is_on = not self._value(index - 0x200, 1) & object_dictionary.TPDO_OFF
            if is_on or (subindex and self._value(index, 0)):
                raise SdoAbortedError(_NOT_NOW)
