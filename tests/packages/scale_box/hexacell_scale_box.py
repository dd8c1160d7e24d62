"""A box with six absolute scales on the network: ``5 READ`` has it take all six at once.

It answers ``5 100 200 300 400 500 600``: the number of the request, then the counts of legs 1 to 6.
``1 NAME`` asks its name. ``bus`` of the cell file's encoders is ``{ host = "...", port = ... }``.
"""

import asyncio
from itertools import count

from drivers.encoders.bank import joint_variables
from drivers.errors import BusError, SilentNodeError
from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.wire_trace import TraceRecorder
from hexacell.cell.devices import EncoderSettings
from hexacell.errors import DeviceError

SUBJECT = "encoders"


class ScaleBox:
    """The encoder bank; the number in an answer tells a late one from that to the present request."""

    def __init__(self, settings: EncoderSettings, trace: TraceRecorder | None = None) -> None:
        del trace
        self._settings = settings
        self._numbers = count(1)
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """Connect, and ask for its name."""
        await self.close()
        bus = self._settings.bus or {}
        try:
            async with asyncio.timeout(self._settings.timeout_s):
                self._streams = await asyncio.open_connection(bus["host"], bus["port"])
            name = await self._ask("NAME")
        except (OSError, TimeoutError) as error:
            raise self._lost(error) from error
        return tuple(DeviceIdentity(f"encoder of leg {leg}", "scale-box", name) for leg in range(1, 7))

    async def read(self) -> EncoderSample:
        """Six counts of one instant."""
        counts = tuple(int(word) for word in (await self._ask("READ")).split())
        if len(counts) != 6:
            raise DeviceError(f"tells {len(counts)} counts of six", subject=SUBJECT, action="Open it again")
        return EncoderSample(counts, joint_variables(counts, self._settings), self._settings.unit)

    async def close(self) -> None:
        """Close the connection."""
        streams, self._streams = self._streams, None
        if streams is not None:
            streams[1].close()

    async def _ask(self, command: str) -> str:
        if self._streams is None:
            raise DeviceError("are not open", subject=SUBJECT, action="Open them first")
        reader, writer = self._streams
        number = str(next(self._numbers))
        writer.write(f"{number} {command}\n".encode())
        try:
            async with asyncio.timeout(self._settings.timeout_s):
                while line := await reader.readline():
                    answered, _, answer = line.decode("ascii").strip().partition(" ")
                    if answered == number:
                        return answer
        except TimeoutError:
            raise SilentNodeError("do not answer", subject=SUBJECT, action="Check their supply") from None
        except OSError as error:
            raise self._lost(error) from error
        raise self._lost(EOFError("the connection was closed"))

    def _lost(self, error: Exception) -> BusError:
        return BusError(f"are not reached: {error}", subject=SUBJECT, action="Check `bus` and the network")
