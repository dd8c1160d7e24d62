"""Stop inputs: a contact or a file that forbids motion.

The contact connects an output of an otherwise unused serial port with one of its inputs, DTR with DSR
(or RTS with CTS). It is closed while motion is allowed, as in an emergency stop circuit: a button
that opens it, a broken wire and an unplugged adapter all forbid motion. The file is for other
programs, and for cells without such a contact: while it exists, nothing moves.
"""

import termios
from pathlib import Path

import serial

from drivers.interfaces import DeviceIdentity
from drivers.serial.opening import close_port, opening_errors, unopened_port
from hexacell.cell.measuring import GuardSettings
from hexacell.errors import HexacellError

SUBJECT = "stop line"
_OUTPUTS = {"dsr": "DTR", "cts": "RTS"}


class CombinedStopInput:
    """A :class:`drivers.interfaces.StopInput`: a file and a contact, each of which forbids motion.

    Args:
        file: forbids motion while it exists.
        url: the serial port of the contact.
        line: its input that the contact closes: dsr or cts.
    """

    def __init__(self, file: Path | None = None, url: str | None = None, line: str = "dsr") -> None:
        self._file, self._url, self._line = file, url, line
        self._port: serial.Serial | None = None

    async def open(self) -> DeviceIdentity | None:
        """Connect the contact, open or not; the identity names the port and line it is wired to.

        Raises:
            DeviceError: The port is absent, in use, or has no such lines.
            FileError: pyserial does not accept the URL.
        """
        await self.close()
        if self._url is None:
            return None
        try:
            with opening_errors(SUBJECT, self._url):
                self._port = unopened_port(self._url)
                self._port.dtr = self._port.rts = True
                self._port.open()
                getattr(self._port, self._line)
        except HexacellError:
            await self.close()
            raise
        return DeviceIdentity(SUBJECT, "contact", f"{self._line.upper()} of {self._url}")

    async def active_reason(self) -> str | None:
        """Why motion is forbidden now, or nothing."""
        of_file = None if self._file is None else _file_reason(self._file)
        return "; ".join(filter(None, (of_file, self._contact_reason()))) or None

    async def close(self) -> None:
        """Release the contact; closing twice is harmless."""
        port, self._port = self._port, None
        if port is not None:
            close_port(port)

    def _contact_reason(self) -> str | None:
        """The reason, if the contact is open or the port was lost. It takes one system call."""
        if self._url is None:
            return None
        if self._port is None:
            return f"its port {self._url} is not open"
        try:
            closed = bool(getattr(self._port, self._line))
        except (OSError, termios.error) as error:
            return f"its port {self._url} was lost ({error})"
        wire = f"{_OUTPUTS[self._line]} and {self._line.upper()}"
        return None if closed else f"the contact between {wire} of {self._url} is open"


def _file_reason(path: Path) -> str | None:
    """The reason, if the file exists or that cannot be determined."""
    try:
        path.lstat()
    except FileNotFoundError:
        return None
    except OSError as error:
        return f"{path} cannot be checked: {error.strerror}"
    return f"{path} exists"


def stop_input_of(settings: GuardSettings, folder: Path) -> CombinedStopInput:
    """The stop input of a cell file in ``folder``, from its section [guards]."""
    file = None if settings.stop_file is None else folder / settings.stop_file
    return CombinedStopInput(file, settings.stop_port, settings.stop_contact)
