"""Devices for people."""

from __future__ import annotations

from procedures.run.events import Identity


def device_words(identity: Identity) -> str:
    """Who answered, and how."""
    serial = f", serial number {identity.serial_number}" if identity.serial_number else ""
    return f"{identity.name}, {identity.protocol}{serial}: {identity.description}"
