"""Settings of an encoder that change what its counts mean: read at opening, compared ever after.

A preset, a reversed direction or an offset that somebody set since the cell was set up changes a joint
variable without moving the joint. They become a part of the device's identity, which every run records and
compares.
"""

from __future__ import annotations

from drivers.encoders.canopen_node import EncoderNode
from drivers.encoders.object_dictionary import (
    OFFSET,
    OPERATING_PARAMETERS,
    PRESET,
    SYNC_COUNTER,
    WARNINGS,
    ObjectEntry,
)

REVERSED = 1 << 3
"""Bit of the operating parameters: counts grow in the other direction (CiA 406)."""

_HALF = 1 << 31


def read_settings(node: EncoderNode) -> str:
    """Direction, preset and offset in words, those that the device has."""
    words = []
    parameters = node.read_optional(OPERATING_PARAMETERS)
    if parameters is not None:
        direction = "reversed, " if parameters & REVERSED else ""
        words.append(f"operating parameters {direction}{parameters:#06x}")
    for name, entry in (("preset", PRESET), ("offset", OFFSET)):
        value = _signed(node, entry)
        words += [] if value is None else [f"{name} {value}"]
    return ", ".join(words)


def read_warnings(node: EncoderNode) -> str:
    """The warnings that the device reports, in words; empty without."""
    value = node.read_optional(WARNINGS)
    return f"it reports a warning: {WARNINGS} is {value:#06x}" if value else ""


def switch_sync_counter_off(node: EncoderNode) -> None:
    """Have the node take a SYNC without a counter, as this program sends it.

    Raises:
        DeviceError: it refuses that.
    """
    if node.read_optional(SYNC_COUNTER):
        node.write(SYNC_COUNTER, 0)


def _signed(node: EncoderNode, entry: ObjectEntry) -> int | None:
    value = node.read_optional(entry)
    return value if value is None or value < _HALF else value - 2 * _HALF
