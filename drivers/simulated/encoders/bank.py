"""The simulated encoder bank: samples positions at every SYNC and sends counts; and its faults."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Sequence
from typing import Any, Self

from drivers.simulated.closeable import Closeable
from drivers.simulated.encoders.can_bus import SimulatedCanBus
from drivers.simulated.encoders.node import DeviceData, SimulatedEncoder
from drivers.simulated.encoders.object_dictionary import EVENTS_AND_SYNC, Vendor
from hexacell.cell.devices import EncoderSettings
from hexacell.clock import CellClock

Positions = Callable[[], Sequence[float]]

_SYNC = 0x080
_ALL_BITS = 1 << 32
FIRST_SERIAL_NUMBER = 1001


class SimulatedEncoderBank(Closeable):
    """Six encoders on a virtual CAN bus of their own; a context manager, or started and closed.

    ``positions`` gives the six joint variables now, mm, with noise; it is called at the start, and at
    every SYNC on the thread of the bus. Responses to a SYNC are spread over ``latency_s`` of the cell's
    time. Serial numbers are those of the cell file, or 1001 and up. ``faults`` injects faults.
    """

    def __init__(
        self,
        settings: EncoderSettings,
        positions: Positions,
        clock: CellClock,
        latency_s: float = 0.0,
        vendors: Sequence[Vendor] = (EVENTS_AND_SYNC,) * 6,
    ) -> None:
        self.channel = f"hexacell-encoders-{uuid.uuid4().hex}"
        self.bus = SimulatedCanBus(self.channel)
        self.unplugged: set[int] = set()
        self.faults = EncoderFaults(self)
        self._settings = settings
        self._positions = positions
        self._clock = clock
        self._latency_s = latency_s
        self._vendors = tuple(vendors)
        serial_numbers = settings.serial_numbers or range(FIRST_SERIAL_NUMBER, FIRST_SERIAL_NUMBER + 6)
        self._encoders = tuple(
            self._make(leg, serial_number) for leg, serial_number in enumerate(serial_numbers, 1)
        )
        self._duplicates: list[tuple[int, SimulatedEncoder]] = []

    @property
    def bus_settings(self) -> dict[str, Any]:
        """The settings for ``can.Bus`` to reach the bank from this process."""
        return {"interface": "virtual", "channel": self.channel}

    def start(self) -> None:
        """Switch the encoders on."""
        with self.bus.lock:
            self._sample()
            self.bus.subscribe(_SYNC, self._on_sync)
            for leg, encoder in enumerate(self._encoders, 1):
                if leg not in self.unplugged:
                    encoder.plug_in()
        self.bus.start()

    def close(self) -> None:
        """Switch them off and close the channel; closing twice is harmless."""
        self.bus.close()

    def __enter__(self) -> Self:
        self.start()
        return self

    def encoder(self, leg: int) -> SimulatedEncoder:
        """The encoder of a leg, from 1."""
        return self._encoders[leg - 1]

    def add_duplicate(self, leg: int) -> None:
        """Add a second device with the node id of a leg."""
        duplicate = self._make(leg, self.encoder(leg).data.serial_number + 1000)
        self._duplicates.append((leg, duplicate))
        duplicate.plug_in()

    def _make(self, leg: int, serial_number: int) -> SimulatedEncoder:
        settings = self._settings
        data = DeviceData(
            settings.nodes[leg - 1], serial_number, round(settings.measuring_step_nm), settings.signed
        )
        return SimulatedEncoder(self.bus, self._vendors[leg - 1], data, self._clock.real_seconds)

    def _on_sync(self, _can_id: int, _data: bytearray, _timestamp: float) -> None:
        self._sample()
        devices = [*self._encoders, *(duplicate for _, duplicate in self._duplicates)]
        for place, encoder in enumerate(devices, 1):
            delay_s = self._latency_s * place / len(devices) + encoder.delay_s
            for cob_id, data in encoder.on_sync():
                self._send_later(encoder, cob_id, data, delay_s)

    def _send_later(self, encoder: SimulatedEncoder, cob_id: int, data: bytes, delay_s: float) -> None:
        if delay_s:
            self.bus.call_later(self._clock.real_seconds(delay_s), lambda: encoder.send(cob_id, data))
        else:
            encoder.send(cob_id, data)

    def _sample(self) -> None:
        positions = self._positions()
        for leg, (encoder, position) in enumerate(zip(self._encoders, positions, strict=True), 1):
            encoder.counts = self._counts(leg, position)
        for leg, duplicate in self._duplicates:
            duplicate.counts = self.encoder(leg).counts

    def _counts(self, leg: int, position_mm: float) -> int:
        """The counts at a position; they wrap around at 32 bits."""
        settings = self._settings
        step_mm = settings.measuring_step_nm * 1e-6
        from_zero = (position_mm - settings.offset_mm[leg - 1]) * settings.direction[leg - 1]
        counts = round(from_zero / step_mm) % _ALL_BITS
        return counts - _ALL_BITS if settings.signed and counts >= _ALL_BITS // 2 else counts


NO_MAGNET = 0xFF00
POSITION_ERROR = 0x21
"""Error register: generic and device profile specific."""


class EncoderFaults:
    """Injects faults into a bank, at once, from any thread."""

    def __init__(self, bank: SimulatedEncoderBank) -> None:
        self._bank = bank

    def unplug(self, leg: int) -> None:
        """The node disappears; before ``start``: it does not appear."""
        with self._bank.bus.lock:
            self._bank.encoder(leg).unplug()
            self._bank.unplugged.add(leg)

    def plug_in(self, leg: int) -> None:
        """The node comes back, without configuration."""
        with self._bank.bus.lock:
            self._bank.unplugged.discard(leg)
            self._bank.encoder(leg).plug_in()

    def add_duplicate(self, leg: int) -> None:
        """A second device with the same node id and another serial number appears."""
        with self._bank.bus.lock:
            self._bank.add_duplicate(leg)

    def silence(self, leg: int, *, silent: bool = True) -> None:
        """The node no longer responds to SYNC, but to everything else."""
        with self._bank.bus.lock:
            self._bank.encoder(leg).is_silent = silent

    def emergency(self, leg: int, code: int = NO_MAGNET, register: int = POSITION_ERROR) -> None:
        """The node reports an error; ``clear_emergency`` ends it."""
        with self._bank.bus.lock:
            self._bank.encoder(leg).emergency(code, register)

    def clear_emergency(self, leg: int) -> None:
        """The node reports that the error is gone."""
        self.emergency(leg, 0, 0)

    def alarm(self, leg: int, bits: int = 1) -> None:
        """The node sets alarms in 6503h without a message; 0 clears them."""
        with self._bank.bus.lock:
            self._bank.encoder(leg).set_alarms(bits)

    def reboot(self, leg: int) -> None:
        """The node restarts and loses its configuration."""
        with self._bank.bus.lock:
            self._bank.encoder(leg).boot()

    def stop_heartbeat(self, leg: int) -> None:
        """The heartbeat of the node ends; it still responds."""
        with self._bank.bus.lock:
            self._bank.encoder(leg).stop_heartbeat()

    def delay(self, leg: int, seconds: float) -> None:
        """The responses of the node are delayed; they keep the sample of their SYNC."""
        with self._bank.bus.lock:
            self._bank.encoder(leg).delay_s = seconds

    def kill_bus(self) -> None:
        """All nodes become silent permanently."""
        self._bank.bus.stop()
