"""Simulated encoders that send what a DBC file describes."""

from __future__ import annotations

import uuid
from typing import Any

from drivers.encoders.dbc import PositionSignal, read_database
from drivers.simulated.encoders.bank import JUMP, Positions, shown_positions
from drivers.simulated.encoders.can_bus import PeriodicAction, SimulatedCanBus
from drivers.simulated.served_device import Closeable, Switch, setting
from hexacell.cell.described_devices import DbcSettings
from hexacell.cell.devices import EncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.errors import FileError

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


class SimulatedDbcBank(Closeable):
    """Six encoders on a virtual CAN bus, each with a message of its own.

    ``positions`` gives the six joint variables; they are sent every five milliseconds of real time, or when
    the request of the cell file comes.
    """

    def __init__(self, settings: EncoderSettings, described: DbcSettings, positions: Positions) -> None:
        self._settings, self._positions = settings, positions
        database = read_database(described, settings.unit, settings.step)
        self._signals = database.signals
        if len(database.frames) < len(self._signals):
            raise FileError("legs share a message", subject=described.file, action="Give each leg its own")
        self.channel = f"hexacell-encoders-{uuid.uuid4().hex}"
        self.bus_settings: dict[str, Any] = {"interface": "virtual", "channel": self.channel}
        self.address: dict[str, Any] = {"bus": self.bus_settings}
        self.bus = SimulatedCanBus(self.channel)
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

    def close(self) -> None:
        self.bus.close()

    def _send(self) -> None:
        positions = shown_positions(self._settings, self._positions)
        for signal, encoder, position in zip(self._signals, self._encoders, positions, strict=True):
            data = encoder.frame(position)
            if not encoder.is_silent:
                self.bus.send_message(signal.frame.number, data)
