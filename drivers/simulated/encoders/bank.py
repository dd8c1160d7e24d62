"""The simulated encoders on a virtual CAN bus: CANopen nodes, and those that a DBC file describes."""

import itertools
import uuid
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from drivers.encoders.dbc import PositionSignal, read_signals
from drivers.simulated.encoders import object_dictionary as od
from drivers.simulated.encoders.can_bus import PeriodicAction, SimulatedCanBus
from drivers.simulated.encoders.node import COUNTER_OVERFLOW, DIRTY_SCALE, REVERSED, SimulatedEncoder
from drivers.simulated.encoders.object_dictionary import EVENTS_AND_SYNC, ROTARY, DeviceData, Vendor
from drivers.simulated.served_device import Closeable, Switch, setting
from hexacell.cell.described_devices import DbcSettings
from hexacell.cell.devices import NM, EncoderSettings, RotaryEncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.clock import CellClock
from hexacell.errors import FileError
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


class _CanBank(Closeable):
    """Encoders on a virtual CAN bus of their own; ``address`` is where a driver finds them."""

    def __init__(self) -> None:
        self.channel = f"hexacell-encoders-{uuid.uuid4().hex}"
        self.bus_settings: dict[str, Any] = {"interface": "virtual", "channel": self.channel}
        self.address: dict[str, Any] = {"bus": self.bus_settings}
        self.bus = SimulatedCanBus(self.channel)

    def close(self) -> None:
        self.bus.close()


class SimulatedEncoderBank(_CanBank):
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
        super().__init__()
        self._settings = settings
        self._positions = positions
        self._clock = clock
        self._latency_s = latency_s
        usual = ROTARY if settings.unit is JointUnit.DEG else EVENTS_AND_SYNC
        step = round(settings.step / NM)
        if isinstance(settings, RotaryEncoderSettings):
            step = settings.counts_per_turn
        serial_numbers = settings.serial_numbers or itertools.count(FIRST_SERIAL_NUMBER)
        devices = (
            DeviceData(node, serial_number, step, settings.signed)
            for node, serial_number in zip(settings.nodes, serial_numbers, strict=False)
        )
        self._encoders = tuple(
            SimulatedEncoder(self.bus, vendor, device, clock.real_seconds)
            for vendor, device in zip(vendors or itertools.repeat(usual), devices, strict=False)
        )
        with self.bus.lock:
            self._sample()
            self.bus.subscribe(_SYNC, self._on_sync)
            for encoder in self._encoders:
                encoder.set_unplugged(on=False)
        self.bus.start()

    def faults(self, leg: int) -> dict[FaultKind, Switch]:
        encoder = self._encoders[leg - 1]
        step = encoder.data.step
        switches: dict[FaultKind, Switch] = {
            "unplugged": encoder.set_unplugged,
            "silent": setting(encoder, "is_silent"),
            "alarm": encoder.set_alarm,
            "warning": partial(encoder.set_object, od.WARNINGS, "<H", DIRTY_SCALE),
            "two steps": partial(encoder.set_object, od.MEASURING_STEP, "<I", step // 10, step),
            "SYNC counter": partial(encoder.set_object, od.SYNC_COUNTER, "B", COUNTER_OVERFLOW),
            "switched on again": encoder.switch_on_again,
            "repeated": setting(encoder, "is_doubled"),
            "reversed": partial(encoder.set_object, od.OPERATING_PARAMETERS, "<H", REVERSED),
            "zeroed": encoder.set_zeroed,
            "frozen": setting(encoder, "is_frozen"),
            "jumped": setting(encoder, "shift", round(JUMP / self._settings.step), 0),
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


PERIOD_S = 0.005
"""Period of what they send by themselves, s of real time."""


class SimulatedDbcEncoder:
    """One encoder, and what is wrong with it.

    Attributes:
        shift: by how much it shows more, in the unit of the joint.
        is_silent: it sends nothing.
        has_alarm: the signals that say whether it is healthy have other values.
    """

    def __init__(self, signal: PositionSignal, healthy: dict[str, int]) -> None:
        self._signal, self._healthy = signal, healthy
        self._frozen: float | None = None
        self._position = self.shift = 0.0
        self.is_silent = self.has_alarm = False

    def frame(self, position: float) -> bytes:
        """The data of its message at a position."""
        self._position = position if self._frozen is None else self._frozen
        values: dict[str, Any] = {signal.name: 0 for signal in self._signal.message.signals}
        values |= {name: value + self.has_alarm for name, value in self._healthy.items()}
        values[self._signal.signal.name] = (self._position + self.shift) / self._signal.scale
        data: bytes = self._signal.message.encode(values, strict=False)
        return data

    def set_frozen(self, *, on: bool) -> None:
        """Send the current position for ever, or the true one again."""
        self._frozen = self._position if on else None


class SimulatedDbcBank(_CanBank):
    """Six encoders on a virtual CAN bus, each with a message of its own.

    ``positions`` gives the six joint variables; they are sent every five milliseconds of real time, or when
    the request of the cell file comes.
    """

    def __init__(self, settings: EncoderSettings, described: DbcSettings, positions: Positions) -> None:
        self._settings, self._positions = settings, positions
        self._signals = read_signals(described, settings.unit, settings.step)
        if len({signal.frame for signal in self._signals}) < len(self._signals):
            raise FileError("legs share a message", subject=described.file, action="Give each leg its own")
        super().__init__()
        self._encoders = tuple(SimulatedDbcEncoder(one, described.must_be) for one in self._signals)
        if described.request is None:
            PeriodicAction(self.bus, PERIOD_S, self._send)
        else:
            asked = int(described.request.partition("#")[0], 16)
            self.bus.subscribe(asked, lambda _id, _data, _time: self._send())
        self.bus.start()

    def faults(self, leg: int) -> dict[FaultKind, Switch]:
        encoder = self._encoders[leg - 1]
        return {
            "unplugged": setting(encoder, "is_silent"),
            "silent": setting(encoder, "is_silent"),
            "frozen": encoder.set_frozen,
            "jumped": setting(encoder, "shift", JUMP, 0.0),
            "alarm": setting(encoder, "has_alarm"),
        }

    def _send(self) -> None:
        positions = shown_positions(self._settings, self._positions)
        for signal, encoder, position in zip(self._signals, self._encoders, positions, strict=True):
            data = encoder.frame(position)
            if not encoder.is_silent:
                self.bus.send_message(signal.frame.number, data)
