"""The serial ports of this computer, and the adapter behind each: names may change, adapters do not."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

STABLE_NAMES = (Path("/dev/serial/by-id"), Path("/dev/serial/by-path"))


@dataclass(frozen=True, slots=True)
class SerialPortFound:
    """One port: the name to use in a cell file, the name it has now, and its adapter in words."""

    port: str
    device: str
    adapter: str


def serial_ports() -> tuple[SerialPortFound, ...]:
    """All ports that have hardware, the most lasting name of each: by adapter, else by its USB socket."""
    infos = sorted(list_ports.comports(), key=lambda info: info.device)
    real = [info for info in infos if info.hwid != "n/a"]
    return tuple(SerialPortFound(_lasting(info, real), info.device, adapter_of(info)) for info in real)


def adapter_at(port: str) -> str:
    """The adapter behind a port that is open, in words; empty where there is none or nobody knows.

    It is part of the identity of a device: gauges on two adapters that were plugged in again in another
    order would answer for each other.
    """
    if "://" in port:
        return ""
    device = os.path.realpath(port)
    return next((adapter_of(info) for info in list_ports.comports() if info.device == device), "")


def adapter_of(info: ListPortInfo) -> str:
    """Vendor, product and serial number; the USB socket instead of the number where it has none."""
    if info.vid is None or info.pid is None:
        return ""
    where = f"serial number {info.serial_number}" if info.serial_number else f"socket {info.location}"
    return f"USB {info.vid:04x}:{info.pid:04x} {where}"


def _lasting(info: ListPortInfo, others: Iterable[ListPortInfo]) -> str:
    is_unique = sum(adapter_of(other) == adapter_of(info) for other in others) == 1
    folders = STABLE_NAMES if info.serial_number and is_unique else STABLE_NAMES[1:]
    for folder in folders:
        for link in sorted(folder.glob("*")):
            if os.path.realpath(link) == info.device:
                return str(link)
    return str(info.device)
