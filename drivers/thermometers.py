"""Thermometers that the Linux kernel provides as files, in millidegrees Celsius.

Such files are ``temp1_input`` below /sys/class/hwmon (the kernel's
Documentation/hwmon/sysfs-interface.rst) and ``temperature`` of a DS18B20 below
/sys/bus/w1/devices (Documentation/w1/slaves/w1_therm.rst). Reading the latter makes the sensor measure,
which takes up to 750 ms; the file is empty during another measurement.
"""

import asyncio
import logging
import os
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from drivers.interfaces import DeviceIdentity, TemperatureReading
from hexacell.cell.devices import ThermometerSettings
from hexacell.errors import DeviceError
from hexacell.storage.atomic_files import os_error_to_file_error

MAX_BYTES = 64
SLOW = "State a longer timeout_s, or let no other program read"
RIGHTS, OTHER = "Let this user read", "Name a file with millidegrees, not"
PLAUSIBLE_C = (-100.0, 300.0)
UNMEASURED, DS18B20 = "85000", "temperature"
"""What a DS18B20, whose file has this name, gives until it has measured since its supply came."""

_log = logging.getLogger(__name__)


class SysfsThermometer:
    """A thermometer read from a file; implements :class:`drivers.interfaces.Thermometer`.

    A read may block in the kernel. Each thermometer has its own thread, with one read at a time.
    """

    def __init__(self, settings: ThermometerSettings) -> None:
        self._settings = settings
        self._path, self._subject = Path(settings.path), f"thermometer {settings.name}"
        self._thread: ThreadPoolExecutor | None = None
        self._reading: Future[str] | None = None

    @property
    def name(self) -> str:
        """Its name in the cell file."""
        return self._settings.name

    async def open(self) -> DeviceIdentity:
        """Read it once; raises ``DeviceError`` if that gives no temperature."""
        _log.info("%s: opened, %s", self._subject, (await self.read()).raw)
        return DeviceIdentity(self._subject, "sysfs", str(self._path))

    async def read(self) -> TemperatureReading:
        """The temperature now, deg C. Raises ``DeviceError``: the file gives none, or not in time."""
        if self._reading is not None and not self._reading.done():
            raise self._error("still does not answer", SLOW)
        self._thread = self._thread or ThreadPoolExecutor(1, thread_name_prefix="thermometer")
        self._reading = self._thread.submit(_content, self._path)
        try:
            async with asyncio.timeout(self._settings.timeout_s):
                raw = await asyncio.shield(asyncio.wrap_future(self._reading))
        except TimeoutError:
            raise self._error(f"does not answer within {self._settings.timeout_s:g} s", SLOW) from None
        except OSError as error:
            plain = os_error_to_file_error("cannot be read", self._path, error)
            check = RIGHTS if isinstance(error, PermissionError) else "Connect it, or correct path"
            raise self._error(plain.problem, check) from error
        try:
            celsius = int(raw) / 1000
        except ValueError:
            raise self._error(f"gives no number but {raw!r}", OTHER if raw else SLOW) from None
        if raw == UNMEASURED and self._path.name == DS18B20:
            raise self._error("gives 85 deg C, as it does unmeasured", "Check the supply and cable of")
        low, high = PLAUSIBLE_C
        if not low <= celsius <= high:
            raise self._error(f"gives {celsius:g} deg C, which is implausible")
        return TemperatureReading(celsius, raw)

    async def close(self) -> None:
        """End the thread; closing twice is harmless."""
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.shutdown(wait=self._reading is None or self._reading.done(), cancel_futures=True)

    def _error(self, problem: str, check: str = "Check the sensor behind") -> DeviceError:
        return DeviceError(problem, subject=self._subject, action=f"{check} {self._path}")


def _content(path: Path) -> str:
    # Non-blocking, in case the path is a pipe; it makes no difference for kernel files.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        return os.read(descriptor, MAX_BYTES).decode("ascii", errors="replace").strip()
    finally:
        os.close(descriptor)
