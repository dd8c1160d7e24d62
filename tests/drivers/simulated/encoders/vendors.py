"""Encoders of other vendors than the simulated cell's, which the driver must configure too."""

from __future__ import annotations

from drivers.simulated.encoders.object_dictionary import TpdoDefaults, Vendor

_POSITION = (0x6004, 0, 32)
_SPEED = (0x6030, 1, 16)
_MAGNET_1 = (0x6020, 1, 32)
_MAGNET_2 = (0x6020, 2, 32)

EVENTS_ONLY = Vendor(
    device_type=0x0008_0196,
    tpdos=(
        TpdoDefaults((_POSITION,), transmission_type=254, event_timer_ms=1),
        TpdoDefaults((), transmission_type=1, enabled=False),
    ),
    step_in_6005=False,
)
"""TPDO1 every millisecond, TPDO2 off and empty; the step is in 6501h."""

TWO_MAGNETS = Vendor(
    device_type=0x000A_0196,
    tpdos=(
        TpdoDefaults((_MAGNET_1, _SPEED), transmission_type=254, event_timer_ms=10),
        TpdoDefaults((_MAGNET_2, _MAGNET_1), transmission_type=1),
    ),
    mapping_writable=False,
    magnets=2,
)
"""Positions in 6020h, and a fixed mapping in which the first magnet comes second."""
