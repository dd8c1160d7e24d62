"""Finds devices whose addresses nobody knows: only questions are sent, and every wait is bounded."""

import asyncio
from contextlib import suppress
from dataclasses import dataclass

from hexacell.cell.described_devices import BOOT_S


@dataclass(frozen=True, slots=True)
class SearchTimeouts:
    """How long a search waits, s: on a busy computer adapters and first answers take their time.

    Attributes:
        gauge: for an answer of a gauge.
        visa: for the name of an instrument with VISA.
        adapter: for a CAN adapter, and for the first node on a bus.
        node: for each further node on a bus.
        listen: to what devices send unasked.
        restart: for devices that restart because their port was opened.
        controller: for the greeting of a controller.
    """

    gauge: float = 0.5
    visa: float = 2.0
    adapter: float = 2.0
    node: float = 0.5
    listen: float = 1.0
    restart: float = BOOT_S
    controller: float = 2.0


USUAL = SearchTimeouts()


LINUXCNCRSH_PORT = 5007
GREETING = b"hello EMC hexacell 1.0\r\n"


@dataclass(frozen=True, slots=True)
class FoundController:
    """A linuxcncrsh that answers; ``greeting`` is what it said."""

    host: str
    port: int
    greeting: str


async def search_controller(
    host: str, port: int = LINUXCNCRSH_PORT, timeouts: SearchTimeouts = USUAL
) -> FoundController | None:
    """The controller at an address; None if nothing answers there, or something else does."""
    with suppress(OSError, TimeoutError):
        async with asyncio.timeout(timeouts.controller):
            reader, writer = await asyncio.open_connection(host, port)
            try:
                writer.write(GREETING)
                answer = (await reader.readline()).decode("ascii", "replace").strip()
            finally:
                writer.close()
            if answer.upper().startswith("HELLO"):
                return FoundController(host, port, answer)
    return None
