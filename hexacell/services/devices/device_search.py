"""What is connected to this computer, and a draft of a cell file from it.

Serial ports with gauges, CAN buses with nodes, a controller.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.discovery import USUAL, FoundController, SearchTimeouts, encoders, search_controller
from drivers.discovery.gauges import FoundGauge, PortFindings, probe_of, search_port
from drivers.serial.opening import SerialPortFound, serial_ports
from hexacell.cell.robot import DEFAULT_CONTROLLER
from hexacell.kinematics.parameters import CONSTRAINTS, JointUnit
from hexacell.noise.standstill import PADDED
from hexacell.plugins import Group, load, names
from hexacell.services.devices.cell_answers import GAUGE_AXES, Document
from hexacell.services.devices.first_cell import BITRATE, CellDraft


@dataclass(frozen=True)
class SearchFindings:
    """What was found; all ``ports`` that were looked at, and the protocols in which nothing was asked."""

    ports: tuple[SerialPortFound, ...]
    gauges: tuple[PortFindings, ...]
    buses: tuple[encoders.BusFindings, ...]
    controller: FoundController | None
    untried: tuple[str, ...] = ()


async def search_devices(
    named_ports: Sequence[str],
    named_buses: Sequence[dict[str, Any]],
    controller: tuple[str, int],
    timeouts: SearchTimeouts = USUAL,
) -> SearchFindings:
    """Ask at every place, all ports at once; takes some seconds.

    Without ``named_ports``, which may be pyserial URLs, these are all of this computer. ``named_buses`` are
    settings of CAN buses beside those that are found; ``controller`` is a host and a port.
    """
    ports = tuple(SerialPortFound(port, port, "") for port in named_ports) or serial_ports()
    factories = {name: load(Group.GAUGES, name) for name in names(Group.GAUGES)}
    gauges, answering = await asyncio.gather(
        asyncio.gather(*(search_port(port.port, factories, timeouts) for port in ports)),
        search_controller(*controller, timeouts),
    )
    # CAN buses: of the kernel, behind adapters on ports where no gauge answers, and those named.
    silent = [found.port for found in gauges if not found.gauges and not found.problem]
    adapters = await asyncio.gather(
        *(asyncio.to_thread(encoders.speaks_slcan, port, timeouts) for port in silent)
    )
    slcan = [port for port, answers in zip(silent, adapters, strict=True) if answers]
    buses: list[dict[str, Any]] = [
        *({"interface": "socketcan", "channel": name} for name in encoders.socketcan_interfaces()),
        *({"interface": "slcan", "channel": port, "bitrate": BITRATE} for port in slcan),
        *named_buses,
    ]
    searched = await asyncio.gather(
        *(asyncio.to_thread(encoders.search_bus, bus, timeouts) for bus in buses)
    )
    # Numbers that come unasked are reported in any case, and stream is what describes them.
    untried = tuple(name for name in factories if probe_of(factories[name]) is None and name != "stream")
    return SearchFindings(ports, tuple(gauges), tuple(searched), answering, untried)


def draft_of(found: SearchFindings, path: Path) -> CellDraft:
    """The draft at ``path``: what was found is the answer to its question, until a person gives another."""
    gauges = found_gauges(found)[: len(GAUGE_AXES)]
    given: dict[str, str] = {}
    for axis, gauge in zip(GAUGE_AXES, gauges, strict=False):
        given |= {f"gauges.{axis}.protocol": gauge.protocol, f"gauges.{axis}.port": gauge.port}
    of_encoders: Document = {}
    if bank := found_bank(found):
        bus, nodes = bank
        words = (bus.bus.get(key) for key in ("interface", "channel", "bitrate"))
        given["bus"] = " ".join(str(word) for word in words if word is not None)
        given["nodes"] = " ".join(str(node.node) for node in nodes)
        of_encoders = encoder_keys(nodes)
    if found.controller is not None:
        given |= {"controller": DEFAULT_CONTROLLER, "host": found.controller.host}
        given["port"] = str(found.controller.port)
    return CellDraft(path, given, tuple(map(gauge_keys, gauges)), of_encoders)


def found_gauges(found: SearchFindings) -> tuple[FoundGauge, ...]:
    """All gauges, in the order of their ports."""
    return tuple(gauge for port in found.gauges for gauge in port.gauges)


def found_bank(found: SearchFindings) -> tuple[encoders.BusFindings, tuple[encoders.FoundNode, ...]] | None:
    """The first bus with encoders, and these."""
    for bus in found.buses:
        if nodes := tuple(node for node in bus.nodes if node.unit is not None):
            return bus, nodes
    return None


def gauge_keys(gauge: FoundGauge) -> Document:
    """What a gauge reported beside its address: its channel, its line and the last digit of its display."""
    decimals = len(gauge.shown.rstrip("<=>, M").partition(".")[2])
    channel = {} if gauge.channel is None else {"channel": gauge.channel}
    line = {} if gauge.baudrate is None else {"serial": {"baudrate": gauge.baudrate}}
    step = {"resolution_mm": round(10.0**-decimals, decimals)} if 0 < decimals < PADDED else {}
    return {**channel, **line, **step}


def encoder_keys(nodes: tuple[encoders.FoundNode, ...]) -> Document:
    """What all six encoders reported beside their ids: what a count is, and their serial numbers."""
    steps = {node.step for node in nodes}
    numbers = [node.serial_number for node in nodes]
    keys: Document = {}
    if len(steps) == 1 and None not in steps:
        word = "counts_per_turn" if nodes[0].unit is JointUnit.DEG else "measuring_step_nm"
        keys[word] = steps.pop()
    if len(nodes) == CONSTRAINTS and None not in numbers:
        keys["serial_numbers"] = numbers
    return keys
