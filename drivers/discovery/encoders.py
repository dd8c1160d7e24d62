"""Which CAN adapters are there, and what is on a bus.

It is listened to for a while, for encoders that are no CANopen nodes; then each of 127 node ids is asked.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.discovery.frames import FoundFrame, OverheardFrames, of_no_node
from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode, Leg
from drivers.encoders.object_dictionary import (
    DEVICE_TYPE,
    ENCODER_PROFILE,
    MEASURING_STEP,
    MEASURING_STEP_SETTING,
    SERIAL_NUMBER,
    UNITS_PER_TURN,
    DeviceType,
)
from drivers.errors import BusError
from drivers.serial.port import NoAnswer, SerialPort
from hexacell.errors import HexacellError
from hexacell.kinematics.parameters import JointUnit

TIMEOUT_S = 0.5
FIRST_RESPONSE_S = 2.0
"""Longest wait for an adapter, and for the first node: on a busy computer they take their time."""

LISTEN_S = 1.0

SLCAN_LINE = {"baudrate": 115200}
SLCAN_QUESTION = b"\rV\r"
"""Its version; the first line end ends whatever was asked before in another protocol."""
SLCAN_VERSION = re.compile(rb"\a*V[0-9A-Fa-f]{4}\r")
NETWORK_DEVICES = Path("/sys/class/net")
ARPHRD_CAN = "280"
"""The type of a CAN interface (linux/if_arp.h)."""


@dataclass(frozen=True, slots=True)
class FoundNode:
    """A CANopen node that answers. ``step``: nm a count, or counts a turn; none if it does not tell."""

    node: int
    description: str
    serial_number: int | None = None
    step: int | None = None
    unit: JointUnit | None = None


@dataclass(frozen=True, slots=True)
class BusFindings:
    """What is on a bus, or why it cannot be used. ``frames`` came by themselves, and of no such node."""

    bus: Mapping[str, Any]
    nodes: tuple[FoundNode, ...] = ()
    frames: tuple[FoundFrame, ...] = ()
    problem: str = ""


def socketcan_interfaces() -> tuple[str, ...]:
    """The CAN interfaces of the kernel."""
    found = []
    for device in sorted(NETWORK_DEVICES.glob("*")):
        with suppress(OSError):
            if (device / "type").read_text().strip() == ARPHRD_CAN:
                found.append(device.name)
    return tuple(found)


def speaks_slcan(port: str) -> bool:
    """Whether a CAN adapter with the slcan protocol answers on a serial port; it is asked its version."""
    line = SerialPort(port, SLCAN_LINE, threading.Event())
    with closing(line), suppress(HexacellError, NoAnswer):
        line.open()
        return SLCAN_VERSION.fullmatch(line.exchange(SLCAN_QUESTION, b"\r", FIRST_RESPONSE_S)) is not None
    return False


def search_bus(bus: Mapping[str, Any]) -> BusFindings:
    """What sends by itself on a bus, and the nodes that answer, by node id."""
    overheard = OverheardFrames()
    try:
        with closing(EncoderBus(bus, threading.Event(), accepts=overheard.accepts)) as opened:
            return _findings(bus, opened, overheard)
    except HexacellError as error:
        return BusFindings(bus, problem=str(error))


def _findings(bus: Mapping[str, Any], opened: EncoderBus, overheard: OverheardFrames) -> BusFindings:
    try:
        opened.listen(LISTEN_S)
        frames = overheard.counted(LISTEN_S)
        ids = responding_nodes(opened)
        nodes = tuple(_described(opened, node) for node in ids)
    except BusError as error:
        raise BusError(
            error.problem,
            subject=opened.name,
            action="Check cable and termination, or try another bit rate",
        ) from error
    return BusFindings(bus, nodes, of_no_node(frames, ids))


def responding_nodes(bus: EncoderBus) -> list[int]:
    """The nodes that respond to a question to each: until no further one does for a while."""
    scanner = bus.network.scanner
    scanner.search()
    bus.wait_for(lambda: bool(scanner.nodes), FIRST_RESPONSE_S)
    while bus.wait_for(lambda known=set(scanner.nodes): set(scanner.nodes) != known, TIMEOUT_S):  # type: ignore[misc]
        pass
    return sorted(set(scanner.nodes))


def _described(bus: EncoderBus, number: int) -> FoundNode:
    node = EncoderNode(Leg(0, number), bus, TIMEOUT_S)
    kind = node.read_optional(DEVICE_TYPE)
    if kind not in set(DeviceType):
        profile = "" if kind is None else f", profile {kind & 0xFFFF}; encoders are {ENCODER_PROFILE}"
        return FoundNode(number, f"no encoder that is known{profile}")
    device = DeviceType(kind)
    entries = [UNITS_PER_TURN] if device.unit is JointUnit.DEG else [MEASURING_STEP_SETTING]
    steps = (node.read_optional(entry) for entry in (*entries, MEASURING_STEP))
    step = next((value for value in steps if value is not None), None)
    return FoundNode(number, device.description, node.read_optional(SERIAL_NUMBER), step, device.unit)
