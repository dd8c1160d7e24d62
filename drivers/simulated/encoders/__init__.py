"""Six CANopen encoders that answer on the wire, each sampled at the same SYNC."""

from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.simulated.encoders.object_dictionary import EVENTS_AND_SYNC, EVENTS_ONLY, TWO_MAGNETS, Vendor

__all__ = ["EVENTS_AND_SYNC", "EVENTS_ONLY", "TWO_MAGNETS", "SimulatedEncoderBank", "Vendor"]
