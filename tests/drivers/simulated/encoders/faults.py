"""Faults of simulated encoders that no cell file can plan; legs count from 1."""

import struct
from dataclasses import replace

from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.simulated.encoders.node import SimulatedEncoder
from drivers.simulated.encoders.object_dictionary import ALARMS


def add_duplicate(bank: SimulatedEncoderBank, leg: int) -> None:
    """A second device with the same node id and another serial number appears."""
    first = bank._encoders[leg - 1]
    data = replace(first.data, serial_number=first.data.serial_number + 1000)
    duplicate = SimulatedEncoder(bank.bus, first._vendor, data, first._real_seconds)
    with bank.bus.lock:
        duplicate.set_unplugged(on=False)


def set_alarms(bank: SimulatedEncoderBank, leg: int, bits: int = 1) -> None:
    """The node sets alarms in 6503h without a message; 0 clears them."""
    with bank.bus.lock:
        bank._encoders[leg - 1]._node.set_data(ALARMS, 0, struct.pack("<H", bits))
