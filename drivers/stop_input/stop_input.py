"""Stop inputs: a contact or a file that forbids motion.

The contact connects an output of an otherwise unused serial port with one of its inputs, DTR with DSR
(or RTS with CTS). It is closed while motion is allowed, as in an emergency stop circuit: a button
that opens it, a broken wire and an unplugged adapter all forbid motion. The file is for other
programs, and for cells without such a contact: while it exists, nothing moves.
"""

from __future__ import annotations

import termios
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import serial

from drivers.interfaces import DeviceIdentity
from drivers.serial.errors import opening_errors
from hexacell.cell.limits import GuardSettings
from hexacell.errors import HexacellError

SUBJECT = "stop line"
_OUTPUTS = {"dsr": "DTR", "cts": "RTS"}


class StopSource(Protocol):
    """One source that can forbid motion; ``device`` is the port and line it is wired to, if any."""

    device: str

    def open(self) -> None:
        """Connect; it is closed again even if this fails."""
        ...

    def active_reason(self) -> str | None:
        """Why motion is forbidden, or nothing."""
        ...

    def close(self) -> None:
        """Release it."""
        ...


class StopFile:
    """Forbids motion while a file exists, or while that cannot be determined."""

    device = ""

    def __init__(self, path: Path) -> None:
        self._path = path

    def open(self) -> None:
        """Nothing to do."""

    def active_reason(self) -> str | None:
        """The reason, if the file exists."""
        try:
            self._path.lstat()
        except FileNotFoundError:
            return None
        except OSError as error:
            return f"{self._path} cannot be checked: {error.strerror}"
        return f"{self._path} exists"

    def close(self) -> None:
        """Nothing to do."""


class StopContact:
    """Forbids motion while a contact on a serial port is open; ``line`` is dsr or cts."""

    def __init__(self, url: str, line: str) -> None:
        self.device = f"{line.upper()} of {url}"
        self._url = url
        self._line = line
        self._port: serial.Serial | None = None

    def open(self) -> None:
        """Open the port and set its outputs.

        Raises:
            DeviceError: The port is absent, in use, or has no such lines.
            FileError: pyserial does not accept the URL.
        """
        self.close()
        with opening_errors(SUBJECT, self._url):
            self._port = serial.serial_for_url(self._url, do_not_open=True)
            self._port.dtr = self._port.rts = True
            self._port.open()
            getattr(self._port, self._line)

    def active_reason(self) -> str | None:
        """The reason, if the contact is open or the port was lost. It takes one system call."""
        if self._port is None:
            return f"its port {self._url} is not open"
        try:
            closed = bool(getattr(self._port, self._line))
        except (OSError, termios.error) as error:
            return f"its port {self._url} was lost ({error})"
        wire = f"{_OUTPUTS[self._line]} and {self._line.upper()}"
        return None if closed else f"the contact between {wire} of {self._url} is open"

    def close(self) -> None:
        """Close the port; closing twice is harmless."""
        port, self._port = self._port, None
        if port is not None:
            with suppress(OSError, termios.error):
                port.close()


class CombinedStopInput:
    """A :class:`drivers.interfaces.StopInput` made of several sources: any of them forbids motion."""

    def __init__(self, sources: Sequence[StopSource] = ()) -> None:
        self._sources = tuple(sources)

    async def open(self) -> DeviceIdentity | None:
        """Connect all of them, active or not; the identity names those that are wired.

        Raises:
            HexacellError: One cannot be connected.
        """
        try:
            for source in self._sources:
                source.open()
        except HexacellError:
            await self.close()
            raise
        devices = [source.device for source in self._sources if source.device]
        return DeviceIdentity(SUBJECT, "contact", ", ".join(devices)) if devices else None

    async def active_reason(self) -> str | None:
        """Why motion is forbidden now, or nothing."""
        reasons = [source.active_reason() for source in self._sources]
        return "; ".join(reason for reason in reasons if reason) or None

    async def close(self) -> None:
        """Release all of them; closing twice is harmless."""
        for source in self._sources:
            source.close()


def stop_input_of(settings: GuardSettings, folder: Path) -> CombinedStopInput:
    """The stop input of a cell file in ``folder``, from its section [guards]."""
    sources: list[StopSource] = []
    if settings.stop_file is not None:
        sources.append(StopFile(folder / settings.stop_file))
    if settings.stop_port is not None:
        sources.append(StopContact(settings.stop_port, settings.stop_contact))
    return CombinedStopInput(sources)
