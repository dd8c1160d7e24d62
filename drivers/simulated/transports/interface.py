"""What the near end of a simulated line can do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

CHUNK = 1024


class Transport(Protocol):
    """Carries bytes; used by one thread only. Made plugged in."""

    @property
    def url(self) -> str:
        """What ``serial.serial_for_url`` opens; the same after unplugging and plugging in again."""
        ...

    def descriptors(self) -> list[int]:
        """What to wait for until it can be read."""
        ...

    def receive(self, ready: Sequence[int]) -> bytes:
        """What has come on the descriptors that are ``ready``, perhaps nothing."""
        ...

    def send(self, data: bytes) -> None:
        """Deliver ``data``; lost if nobody listens, as on a cable."""
        ...

    def unplug(self) -> None:
        """Break the line; whoever has it open gets an error, and opening it fails."""
        ...

    def plug_in(self) -> None:
        """Mend it."""
        ...

    def close(self) -> None:
        """Leave nothing behind."""
        ...
