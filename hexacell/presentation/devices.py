"""Text for devices."""

from __future__ import annotations

from drivers.interfaces import DeviceIdentity


def device_line(identity: DeviceIdentity) -> str:
    """Which device answered, with its protocol and serial number."""
    serial = f", serial number {identity.serial_number}" if identity.serial_number else ""
    return f"{identity.name}, {identity.protocol}{serial}: {identity.description}"
