"""The device's end of a simulated serial line."""

from __future__ import annotations

import os
import select
from collections.abc import Sequence
from typing import Protocol

CHUNK = 1024


class Transport(Protocol):
    """Carries bytes to and from one client. Plugged in from the start.

    One thread receives; ``send`` may be called from another one.
    """

    @property
    def url(self) -> str:
        """What ``serial.serial_for_url`` opens; the same after unplugging and plugging in again."""
        ...

    @property
    def connections(self) -> int:
        """How many clients have connected; 0 where a connection cannot be noticed."""
        ...

    def descriptors(self) -> list[int]:
        """The file descriptors to wait on for input."""
        ...

    def receive(self, ready: Sequence[int]) -> bytes:
        """The bytes that came on the descriptors that are ``ready``, possibly none."""
        ...

    def send(self, data: bytes, wait_s: float = 0.0) -> None:
        """Send ``data``; what a full buffer does not take within ``wait_s`` is lost, as on a cable."""
        ...

    def unplug(self) -> None:
        """Break the line: a client that has it open gets an error, and opening it fails."""
        ...

    def plug_in(self) -> None:
        """Restore the line."""
        ...

    def close(self) -> None:
        """Release everything."""
        ...


def write_or_drop(descriptor: int, data: bytes, wait_s: float) -> None:
    """Write to a non-blocking descriptor; what finds no room within ``wait_s`` is dropped."""
    while data:
        if not select.select([], [descriptor], [], wait_s)[1]:
            return
        data = data[os.write(descriptor, data) :]
