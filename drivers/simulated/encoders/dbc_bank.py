"""Simulated encoders that send what a DBC file describes."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from drivers.encoders.dbc import PositionSignal, read_database
from drivers.simulated.encoders.can_bus import PeriodicAction, SimulatedCanBus
from drivers.simulated.served_device import Closeable, Switch
from hexacell.cell.described_devices import DbcSettings
from hexacell.cell.devices import EncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.errors import FileError

PERIOD_S = 0.005
"""Period of what they send by themselves, s of real time."""

JUMP = 400.0

Positions = Callable[[], Sequence[float]]


class SimulatedDbcEncoder:
    """One encoder: its position in the unit of the joint, and what is wrong with it."""

    def __init__(self, signal: PositionSignal, healthy: dict[str, int]) -> None:
        self._signal, self._healthy = signal, healthy
        self._frozen: float | None = None
        self._position = self._shift = 0.0
        self.is_silent = False
        self._has_alarm = False

    def frame(self, position: float) -> bytes:
        """The data of its message at a position."""
        self._position = position if self._frozen is None else self._frozen
        values: dict[str, Any] = {signal.name: 0 for signal in self._signal.message.signals}
        values |= {name: value + self._has_alarm for name, value in self._healthy.items()}
        values[self._signal.signal.name] = (self._position + self._shift) / self._signal.scale
        data: bytes = self._signal.message.encode(values, strict=False)
        return data

    def set_silent(self, *, on: bool) -> None:
        self.is_silent = on

    def set_frozen(self, *, on: bool) -> None:
        """Send the position of now for ever, or the true one again."""
        self._frozen = self._position if on else None

    def set_alarm(self, *, on: bool) -> None:
        """Send other values of the signals that say whether it is healthy."""
        self._has_alarm = on

    def set_jumped(self, *, on: bool) -> None:
        """Send a position far away."""
        self._shift = JUMP if on else 0.0


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
        self.bus = SimulatedCanBus(self.channel)
        self._encoders = tuple(SimulatedDbcEncoder(one, described.must_be) for one in self._signals)
        if described.request is None:
            PeriodicAction(self.bus, PERIOD_S, self._send)
        else:
            asked = int(described.request.partition("#")[0], 16)
            self.bus.subscribe(asked, lambda _id, _data, _time: self._send())
        self.bus.start()

    @property
    def bus_settings(self) -> dict[str, Any]:
        return {"interface": "virtual", "channel": self.channel}

    def faults(self, leg: int) -> dict[FaultKind, Switch]:
        encoder = self._encoders[leg - 1]
        return {
            "unplugged": partial(self._switch, encoder.set_silent),
            "silent": partial(self._switch, encoder.set_silent),
            "frozen": partial(self._switch, encoder.set_frozen),
            "jumped": partial(self._switch, encoder.set_jumped),
            "alarm": partial(self._switch, encoder.set_alarm),
        }

    def close(self) -> None:
        self.bus.close()

    def _switch(self, switch: Switch, *, on: bool) -> None:
        with self.bus.lock:
            switch(on=on)

    def _send(self) -> None:
        settings = self._settings
        places = zip(
            self._signals,
            self._encoders,
            self._positions(),
            settings.offset,
            settings.direction,
            strict=True,
        )
        for signal, encoder, position, offset, direction in places:
            data = encoder.frame((position - offset) * direction)
            if not encoder.is_silent:
                self.bus.send_message(signal.frame.number, data)
