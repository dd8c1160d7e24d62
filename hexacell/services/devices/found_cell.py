"""A draft of a cell file from the devices that were found."""

from __future__ import annotations

from pathlib import Path

from drivers.discovery.encoders import BusFindings, FoundNode
from drivers.discovery.gauges import FoundGauge
from hexacell.kinematics.parameters import JointUnit
from hexacell.services.devices.device_search import SearchFindings
from hexacell.services.devices.first_answers import GAUGE_AXES, Document
from hexacell.services.devices.first_cell import CellDraft, FoundKeys

LEGS = 6


def draft_of(found: SearchFindings, path: Path) -> CellDraft:
    """The draft at ``path``: what was found is the answer to its question, until a person gives another."""
    gauges = found_gauges(found)[: len(GAUGE_AXES)]
    given: dict[str, str] = {}
    for axis, gauge in zip(GAUGE_AXES, gauges, strict=False):
        given |= {f"protocol {axis}": gauge.protocol, f"port {axis}": gauge.port}
    encoders: Document = {}
    if bank := found_bank(found):
        bus, nodes = bank
        words = (bus.bus.get(key) for key in ("interface", "channel", "bitrate"))
        given["bus"] = " ".join(str(word) for word in words if word is not None)
        given["nodes"] = " ".join(str(node.node) for node in nodes)
        encoders = encoder_keys(nodes)
    if found.controller is not None:
        given |= {"host": found.controller.host, "port": str(found.controller.port)}
    return CellDraft(path, given, FoundKeys(tuple(map(gauge_keys, gauges)), encoders))


def found_gauges(found: SearchFindings) -> tuple[FoundGauge, ...]:
    """All gauges, in the order of their ports."""
    return tuple(gauge for port in found.gauges for gauge in port.gauges)


def found_bank(found: SearchFindings) -> tuple[BusFindings, tuple[FoundNode, ...]] | None:
    """The first bus with encoders, and these."""
    for bus in found.buses:
        if encoders := tuple(node for node in bus.nodes if node.unit is not None):
            return bus, encoders
    return None


def unknown_encoders(found: SearchFindings) -> BusFindings | None:
    """The first bus with frames of no CANopen node, which may be those of encoders."""
    return next((bus for bus in found.buses if bus.frames), None)


def gauge_keys(gauge: FoundGauge) -> Document:
    """What a gauge told beside its address: its channel, its line and the last digit of its display."""
    decimals = len(gauge.shown.rstrip("<=>, M").partition(".")[2])
    channel = {} if gauge.channel is None else {"channel": gauge.channel}
    line = {} if gauge.baudrate is None else {"serial": {"baudrate": gauge.baudrate}}
    return {**channel, **line, **({"resolution_mm": round(10.0**-decimals, decimals)} if decimals else {})}


def encoder_keys(nodes: tuple[FoundNode, ...]) -> Document:
    """What encoders told beside their ids, where all six told it: what a count is, and their numbers."""
    steps = {node.step for node in nodes}
    numbers = [node.serial_number for node in nodes]
    keys: Document = {}
    if len(steps) == 1 and None not in steps:
        word = "counts_per_turn" if nodes[0].unit is JointUnit.DEG else "measuring_step_nm"
        keys[word] = steps.pop()
    if len(nodes) == LEGS and None not in numbers:
        keys["serial_numbers"] = numbers
    return keys
