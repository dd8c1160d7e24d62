"""The simulated encoder bank: samples positions at every SYNC and sends counts."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from drivers.simulated.encoders.can_bus import SimulatedCanBus
from drivers.simulated.encoders.node import SimulatedEncoder
from drivers.simulated.encoders.object_dictionary import EVENTS_AND_SYNC, ROTARY, DeviceData, Vendor
from drivers.simulated.served_device import Closeable, Switch, setting
from hexacell.cell.devices import NM, EncoderSettings, RotaryEncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.clock import CellClock
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.rotations import Array

Positions = Callable[[], Sequence[float] | Array]

_SYNC = 0x080
_ALL_BITS = 1 << 32
FIRST_SERIAL_NUMBER = 1001
JUMP = 400.0
"""By how much an encoder that jumps shows more, in the unit of the joint variables."""


def shown_positions(settings: EncoderSettings, positions: Positions) -> list[float]:
    """What each encoder shows now, from its own zero and in its own direction."""
    places = zip(positions(), settings.offset, settings.direction, strict=True)
    return [(float(position) - offset) * direction for position, offset, direction in places]


class SimulatedEncoderBank(Closeable):
    """Six encoders on a virtual CAN bus of their own.

    ``positions`` gives the six joint variables now, mm, with noise; it is called at the start, and at
    every SYNC on the thread of the bus. Responses to a SYNC are spread over ``latency_s`` of the cell's
    time. Serial numbers are those of the cell file, or 1001 and up.
    """

    def __init__(
        self,
        settings: EncoderSettings,
        positions: Positions,
        clock: CellClock,
        latency_s: float = 0.0,
        vendors: Sequence[Vendor] | None = None,
    ) -> None:
        self.channel = f"hexacell-encoders-{uuid.uuid4().hex}"
        self.bus_settings: dict[str, Any] = {"interface": "virtual", "channel": self.channel}
        self.address: dict[str, Any] = {"bus": self.bus_settings}
        self.bus = SimulatedCanBus(self.channel)
        self._settings = settings
        self._positions = positions
        self._clock = clock
        self._latency_s = latency_s
        usual = ROTARY if settings.unit is JointUnit.DEG else EVENTS_AND_SYNC
        step = round(settings.step / NM)
        if isinstance(settings, RotaryEncoderSettings):
            step = settings.counts_per_turn
        serial_numbers = settings.serial_numbers or range(FIRST_SERIAL_NUMBER, FIRST_SERIAL_NUMBER + 6)
        devices = (
            DeviceData(node, serial_number, step, settings.signed)
            for node, serial_number in zip(settings.nodes, serial_numbers, strict=True)
        )
        self._encoders = tuple(
            SimulatedEncoder(self.bus, vendor, device, clock.real_seconds)
            for vendor, device in zip(vendors or (usual,) * 6, devices, strict=True)
        )
        with self.bus.lock:
            self._sample()
            self.bus.subscribe(_SYNC, self._on_sync)
            for encoder in self._encoders:
                encoder.set_unplugged(on=False)
        self.bus.start()

    def close(self) -> None:
        self.bus.close()

    def faults(self, leg: int) -> dict[FaultKind, Switch]:
        encoder = self._encoders[leg - 1]
        switches: dict[FaultKind, Switch] = {
            "unplugged": encoder.set_unplugged,
            "silent": setting(encoder, "is_silent"),
            "alarm": encoder.set_alarm,
            "warning": encoder.set_warning,
            "two steps": encoder.set_two_steps,
            "SYNC counter": encoder.set_sync_counter,
            "switched on again": encoder.switch_on_again,
            "repeated": setting(encoder, "is_doubled"),
            "reversed": encoder.set_reversed,
            "zeroed": encoder.set_zeroed,
            "frozen": setting(encoder, "is_frozen"),
            "jumped": partial(encoder.set_shifted, round(JUMP / self._settings.step)),
        }

        def locked(switch: Switch, *, on: bool) -> None:
            with self.bus.lock:
                switch(on=on)

        return {kind: partial(locked, switch) for kind, switch in switches.items()}

    def _on_sync(self, _can_id: int, _data: bytearray, _timestamp: float) -> None:
        self._sample()
        for place, encoder in enumerate(self._encoders, 1):
            delay_s = self._latency_s * place / len(self._encoders)
            for cob_id, data in encoder.on_sync():
                send = partial(encoder.send, cob_id, data)
                if delay_s:
                    self.bus.call_later(self._clock.real_seconds(delay_s), send)
                else:
                    send()

    def _sample(self) -> None:
        """Sample the counts of all encoders, which wrap around at 32 bits."""
        settings = self._settings
        for encoder, shown in zip(self._encoders, shown_positions(settings, self._positions), strict=True):
            counts = round(shown / settings.step) % _ALL_BITS
            is_negative = settings.signed and counts >= _ALL_BITS // 2
            encoder.sample(counts - _ALL_BITS if is_negative else counts)
