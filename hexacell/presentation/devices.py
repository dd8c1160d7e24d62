"""Text for devices: who answered, and what a preflight found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from drivers.interfaces import DeviceIdentity


def device_line(identity: DeviceIdentity) -> str:
    """Which device answered, with its protocol and serial number."""
    serial = f", serial number {identity.serial_number}" if identity.serial_number else ""
    return f"{identity.name}, {identity.protocol}{serial}: {identity.description}"


def preflight_lines(devices: Sequence[DeviceIdentity]) -> Iterator[str]:
    """What was checked, before the plan is tried on simulated robots."""
    for identity in devices:
        yield f"ok  {device_line(identity)}"
    yield "ok  all points can be reached, all devices answer; nothing was moved"
    yield "Trying the plan on simulated robots within the tolerances, some seconds ..."
