"""What is connected to this computer: serial ports with gauges, CAN buses with nodes, a controller."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from drivers.discovery.controllers import FoundController, search_controller
from drivers.discovery.encoders import BusFindings, search_bus, socketcan_interfaces, speaks_slcan
from drivers.discovery.gauges import PortFindings, search_port
from drivers.serial.adapters import SerialPortFound, serial_ports
from hexacell.plugins import Group, load, names
from hexacell.services.devices.first_answers import DESCRIBED

UNTRIED = DESCRIBED | {"keyence-dl-rs1a"}
"""Protocols that are not tried: the cell file describes them, or the question stops machines (``M0``)."""


@dataclass(frozen=True)
class SearchRequest:
    """Where to look.

    Attributes:
        ports: serial ports or pyserial URLs; none: all of this computer.
        buses: settings of CAN buses beside those that are found.
        bitrate: of the buses that are found, bit/s.
        controller: host and port.
    """

    ports: tuple[str, ...] = ()
    buses: tuple[dict[str, Any], ...] = ()
    bitrate: int = 500_000
    controller: tuple[str, int] = ("127.0.0.1", 5007)


@dataclass(frozen=True)
class SearchFindings:
    """What was found. ``ports`` are those that were looked at, also where nothing answered."""

    ports: tuple[SerialPortFound, ...]
    gauges: tuple[PortFindings, ...]
    buses: tuple[BusFindings, ...]
    controller: FoundController | None


async def search_devices(request: SearchRequest) -> SearchFindings:
    """Ask at every place, all ports at once; takes some seconds."""
    ports = tuple(SerialPortFound(port, port, "") for port in request.ports) or serial_ports()
    factories = {name: load(Group.GAUGES, name) for name in names(Group.GAUGES) if name not in UNTRIED}
    gauges, controller = await asyncio.gather(
        asyncio.gather(*(search_port(port.port, factories) for port in ports)),
        search_controller(*request.controller),
    )
    silent = [found.port for found in gauges if not found.gauges and not found.problem]
    return SearchFindings(ports, tuple(gauges), await _buses(request, silent), controller)


async def _buses(request: SearchRequest, silent_ports: Sequence[str]) -> tuple[BusFindings, ...]:
    """The CAN buses: of the kernel, behind adapters on ports where no gauge answers, and those named."""
    adapters = await asyncio.gather(*(asyncio.to_thread(speaks_slcan, port) for port in silent_ports))
    slcan = [port for port, answers in zip(silent_ports, adapters, strict=True) if answers]
    buses: list[dict[str, Any]] = [
        *({"interface": "socketcan", "channel": name} for name in socketcan_interfaces()),
        *({"interface": "slcan", "channel": port, "bitrate": request.bitrate} for port in slcan),
        *request.buses,
    ]
    return tuple(await asyncio.gather(*(asyncio.to_thread(search_bus, bus) for bus in buses)))
