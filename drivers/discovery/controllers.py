"""Whether a LinuxCNC answers: it is greeted, and nothing is switched or asked for."""

import asyncio
from contextlib import suppress
from dataclasses import dataclass

from drivers.discovery import USUAL, SearchTimeouts

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
