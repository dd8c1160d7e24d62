"""The stop line: a contact or a file by which anybody may forbid motion.

The contact joins an output of an otherwise unused serial port with one of its inputs, DTR with DSR
(or RTS with CTS), and is closed while motion is allowed, as in an emergency stop's chain. A button
that opens it, a broken wire and an adapter that was pulled out are then the same: stop. The file is
for other programs, and for cells without such a contact: while it exists, nothing moves.
"""

from __future__ import annotations

import termios
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import serial

from drivers.interfaces import DeviceIdentity
from drivers.serial.errors import port_open_failed, settings_rejected
from hexacell.cell.limits import GuardSettings
from hexacell.errors import HexacellError

SUBJECT = "stop line"
_OUTPUTS = {"dsr": "DTR", "cts": "RTS"}


class StopSource(Protocol):
    """One way to forbid motion; ``device`` is what it is wired to, if it is wired at all."""

    device: str

    def open(self) -> None:
        """Get ready."""
        ...

    def active_reason(self) -> str | None:
        """Why nothing may move, or nothing."""
        ...

    def close(self) -> None:
        """Let it go."""
        ...


class StopFile:
    """Forbids motion while a file exists, or while nobody can tell whether it does."""

    device = ""

    def __init__(self, path: Path) -> None:
        self._path = path

    def open(self) -> None:
        """Nothing to do."""

    def active_reason(self) -> str | None:
        """Whether the file is there."""
        try:
            self._path.lstat()
        except FileNotFoundError:
            return None
        except OSError as error:
            return f"{self._path} cannot be looked at: {error.strerror}"
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
        """Open the port and feed the contact.

        Raises:
            DeviceError: The port is absent, in use, or has no such lines.
            FileError: The URL means nothing to pyserial.
        """
        self.close()
        try:
            port = serial.serial_for_url(self._url, do_not_open=True)
            port.dtr = port.rts = True
            port.open()
            self._port = port
            getattr(port, self._line)
        except (ValueError, TypeError) as error:
            raise settings_rejected(SUBJECT, self._url, error) from error
        except (OSError, termios.error) as error:
            self.close()
            raise port_open_failed(SUBJECT, self._url, error) from error

    def active_reason(self) -> str | None:
        """Whether the contact is open, or the port was lost. The question is one system call."""
        if self._port is None:
            return f"its port {self._url} is not open"
        try:
            closed = bool(getattr(self._port, self._line))
        except (OSError, termios.error) as error:
            return f"its port {self._url} was lost ({error})"
        wire = f"{_OUTPUTS[self._line]} and {self._line.upper()}"
        return None if closed else f"the contact between {wire} of {self._url} is open"

    def close(self) -> None:
        """Let the port go; twice is harmless."""
        port, self._port = self._port, None
        if port is not None:
            with suppress(OSError, termios.error):
                port.close()


class CombinedStopInput:
    """A :class:`drivers.interfaces.StopInput` made of contacts: any of them forbids motion."""

    def __init__(self, contacts: Sequence[StopSource] = ()) -> None:
        self._contacts = tuple(contacts)

    async def open(self) -> DeviceIdentity | None:
        """Get ready to look at all of them; it may be pressed already. Gives what is wired.

        Raises:
            HexacellError: One is not to be had.
        """
        try:
            for contact in self._contacts:
                contact.open()
        except HexacellError:
            await self.close()
            raise
        devices = [contact.device for contact in self._contacts if contact.device]
        return DeviceIdentity(SUBJECT, "contact", ", ".join(devices)) if devices else None

    async def active_reason(self) -> str | None:
        """Why nothing may move now, or nothing."""
        reasons = [contact.active_reason() for contact in self._contacts]
        return "; ".join(reason for reason in reasons if reason) or None

    async def close(self) -> None:
        """Let all of them go; twice is harmless."""
        for contact in self._contacts:
            contact.close()


def stop_input_of(settings: GuardSettings, folder: Path) -> CombinedStopInput:
    """What a cell file in ``folder`` says under [guards]."""
    contacts: list[StopSource] = []
    if settings.stop_file is not None:
        contacts.append(StopFile(folder / settings.stop_file))
    if settings.stop_port is not None:
        contacts.append(StopContact(settings.stop_port, settings.stop_contact))
    return CombinedStopInput(contacts)
