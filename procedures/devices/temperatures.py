"""How warm it is: kept with every record, and never a reason to stop."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence

from drivers.interfaces import DeviceIdentity, Thermometer
from hexacell.errors import HexacellError
from procedures.run.events import Temperature

_log = logging.getLogger(__name__)


class Thermometers:
    """The cell's thermometers. One that fails gives a record without number, and one warning."""

    def __init__(self, thermometers: Sequence[Thermometer] = ()) -> None:
        self._thermometers = tuple(thermometers)
        self._failing: set[str] = set()

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """Who answers; the others are warned of and may answer later."""
        found = await asyncio.gather(*(self._identity(one) for one in self._thermometers))
        return tuple(identity for identity in found if identity is not None)

    async def read(self) -> tuple[Temperature, ...]:
        """What all of them say now."""
        return tuple(await asyncio.gather(*(self._temperature(one) for one in self._thermometers)))

    async def close(self) -> None:
        """Let all of them go."""
        await asyncio.gather(*(one.close() for one in self._thermometers), return_exceptions=True)

    async def _identity(self, thermometer: Thermometer) -> DeviceIdentity | None:
        try:
            return await thermometer.open()
        except Exception as error:  # a stranger's driver may fail in any way
            self._warn(thermometer.name, error)
            return None

    async def _temperature(self, thermometer: Thermometer) -> Temperature:
        try:
            reading = await thermometer.read()
        except Exception as error:
            self._warn(thermometer.name, error)
            return Temperature(name=thermometer.name, celsius=None, problem=_words(error))
        self._failing.discard(thermometer.name)
        return Temperature(name=thermometer.name, celsius=reading.celsius, raw=reading.raw)

    def _warn(self, name: str, error: Exception) -> None:
        if name not in self._failing:
            _log.warning("%s. Records are taken without this temperature", _words(error))
        self._failing.add(name)


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, HexacellError) else repr(error)
