"""The serial ports of this computer and the adapters behind them; how one is opened, who checks its parity.

Names may change, adapters do not. What pyserial raises becomes an error with the next action.
"""

import errno
import os
import termios
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import serial
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from drivers.errors import PortLost
from hexacell.addresses import require_serial_port
from hexacell.errors import FileError, UsageError
from hexacell.storage.atomic_files import SHORTAGES

SLICE_S = 0.05
"""Longest wait, s, without a look whether the port is to be closed."""
WRITE_SLICE_S = 0.2
OPEN_TRIES = 20
WITHOUT_WRITE_TIMEOUT = "rfc2217://"
"""pyserial has no write time-out there, and refuses to open with one (its issue 412)."""

_ABSENT = ("is absent", "Plug it in or correct port in the cell file")
_NOT_PERMITTED = ("may not be opened by this user", "Let the user into its group: docs/howto-host.md")
_IN_USE = ("is in use", "Close the other program, or ModemManager: docs/howto-host.md")
_NO_SERVER = ("has no server that answers", "Start it, check the network, or correct port in the cell file")
_CAUSES = {
    **{number: (f"cannot be opened: {why}", action) for number, (why, action) in SHORTAGES.items()},
    **dict.fromkeys((errno.ENOENT, errno.ENODEV, errno.ENXIO), _ABSENT),
    **dict.fromkeys((errno.EACCES, errno.EPERM), _NOT_PERMITTED),
    **dict.fromkeys((errno.EBUSY, errno.EAGAIN), _IN_USE),
    **dict.fromkeys((errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ETIMEDOUT), _NO_SERVER),
    errno.EIO: ("cannot be opened: it has no device behind it", _ABSENT[1]),
    errno.ENOTTY: ("is no serial port, or has no control lines", "Correct port in the cell file"),
    errno.EISDIR: ("is a folder", "Correct port in the cell file"),
}


def unopened_port(url: str, **settings: Any) -> serial.Serial:  # noqa: ANN401 - pyserial's
    """What pyserial has for a device path or for a URL that may be named; raises what it does.

    Raises:
        UsageError: pyserial might do something else than open a port there, such as write a file.
    """
    require_serial_port(url)
    return serial.serial_for_url(url, do_not_open=True, **settings)


def opened_port(
    url: str,
    settings: Mapping[str, object],
    subject: str,
    closing: threading.Event,
    inter_byte_timeout_s: float | None = None,
) -> serial.Serial:
    """The port, open; ``settings`` are those of pyserial, ``dtr`` and ``rts``. ``closing`` interrupts it.

    Raises:
        PortLost: the port is absent, in use, or cannot be opened, or ``closing`` is set.
        FileError: pyserial does not accept the URL or a setting.
    """
    attempts = 0
    with opening_errors(subject, url):
        lines = {name: level for name, level in settings.items() if name in {"dtr", "rts"}}
        line_settings: Any = {name: value for name, value in settings.items() if name not in lines}
        port = unopened_port(url, **line_settings)
        port.timeout = SLICE_S  # set once and before opening: a pseudo-terminal refuses later changes
        if not url.lower().startswith(WITHOUT_WRITE_TIMEOUT):
            port.write_timeout = WRITE_SLICE_S
        for name, level in lines.items():
            setattr(port, name, level)
        port.inter_byte_timeout = inter_byte_timeout_s
        while not port.is_open:
            attempts += 1
            try:
                port.open()
            except termios.error as error:
                # A pseudo-terminal refuses parity until its server has reset its speed: glibc's tcsetattr
                # fails if it has nothing left to change (pyserial issue 196).
                if attempts == OPEN_TRIES or error.args[:1] != (errno.EINVAL,):
                    raise
                if closing.wait(SLICE_S):
                    raise PortLost(f"port {url} is closed", subject=subject) from error
    return port


def close_port(port: serial.Serial) -> None:
    """Close a port, even if it was lost."""
    # pyserial's socket:// forgets its socket unclosed if the far side has reset the connection
    connection = getattr(port, "_socket", None)
    with suppress(OSError, termios.error):
        port.close()
    if connection is not None:
        connection.close()


def sent(write: Callable[[bytes], object], data: bytes) -> int:
    """Write a request by a port's ``write``; how long it is. The answer shows whether it arrived.

    pyserial's error also comes if all was sent and this thread was then not scheduled for so long.
    """
    with suppress(serial.SerialTimeoutException):
        write(data)
    return len(data)


def lost_port(subject: str, url: str, reason: str, action: str = "Plug it in") -> PortLost:
    """The error for a port that was open, or should be."""
    if "://" in url:
        action = "Check the network, and that its server runs and serves no other client,"
    elif "multiple access" in reason:  # pyserial's words
        action += ", end any other program that reads it,"
    return PortLost(
        f"port {url} was lost ({reason})",
        subject=subject,
        action=f"{action} and open the device again; its zero, or the set that was being measured, is void",
    )


@contextmanager
def opening_errors(subject: str, url: str) -> Iterator[None]:
    """Convert the errors of opening the port ``url``.

    Raises:
        PortLost: the port is absent, in use, or cannot be opened.
        FileError: pyserial does not accept the URL or a setting.
    """
    try:
        yield
    except UsageError as error:
        raise FileError(error.problem, subject=subject, action=error.action) from error
    except (ValueError, TypeError) as error:
        raise FileError(
            f"port {url} or its serial settings are refused: {error}",
            subject=subject,
            action="Correct port or serial in the cell file",
        ) from error
    except (OSError, termios.error) as error:
        numbers = (*error.args[:1], *getattr(error.__context__, "args", ())[:1])
        number = next((one for one in numbers if isinstance(one, int)), 0)
        problem, action = _CAUSES.get(
            number, (f"cannot be opened: {error}", "Check the device and port in the cell file")
        )
        raise PortLost(f"port {url} {problem}", subject=subject, action=action) from error


STABLE_NAMES = (Path("/dev/serial/by-id"), Path("/dev/serial/by-path"))


@dataclass(frozen=True, slots=True)
class SerialPortFound:
    """One port: the name to use in a cell file, the name it has now, and its adapter in words."""

    port: str
    device: str
    adapter: str


def serial_ports() -> tuple[SerialPortFound, ...]:
    """All ports that have hardware, the most lasting name of each: by adapter, else by its USB socket."""
    infos = sorted(list_ports.comports(), key=lambda info: info.device)
    real = [info for info in infos if info.hwid != "n/a"]
    return tuple(SerialPortFound(_lasting(info, real), info.device, adapter_of(info)) for info in real)


def adapter_at(port: str) -> str:
    """The adapter behind a port that is open, in words; empty where there is none or nobody knows.

    It is part of the identity of a device: gauges on two adapters that were plugged in again in another
    order would answer for each other.
    """
    if "://" in port:
        return ""
    device = os.path.realpath(port)
    return next((adapter_of(info) for info in list_ports.comports() if info.device == device), "")


def adapter_of(info: ListPortInfo) -> str:
    """Vendor, product and serial number; the USB socket instead of the number where it has none."""
    if info.vid is None or info.pid is None:
        return ""
    where = f"serial number {info.serial_number}" if info.serial_number else f"socket {info.location}"
    return f"USB {info.vid:04x}:{info.pid:04x} {where}"


def _lasting(info: ListPortInfo, others: Iterable[ListPortInfo]) -> str:
    is_unique = sum(adapter_of(other) == adapter_of(info) for other in others) == 1
    folders = STABLE_NAMES if info.serial_number and is_unique else STABLE_NAMES[1:]
    for folder in folders:
        for link in sorted(folder.glob("*")):
            if os.path.realpath(link) == info.device:
                return str(link)
    return str(info.device)


BIT_7 = 0x80
DAMAGED = 0xFF
IFLAG = 0
ODD_BITS = {"E": 0, "O": 1}


class ParityInBit7:
    """Parity, which pyserial sends but never checks, as the eighth bit of every byte: ``7E2`` is ``8N2``.

    A byte of wrong parity must not reach a parser as one that looks right. On a line with seven data bits
    no frame has a byte with bit 7 set, so ``FF`` is what damage becomes; a terminal puts ``FF 00`` before
    a damaged byte (PARMRK in termios(3)).
    """

    def __init__(self, odd: int) -> None:
        self._odd = odd

    def encode(self, data: bytes) -> bytes:
        """``data`` of seven bits a byte, with the parity in bit 7."""
        return bytes(byte | BIT_7 * self._parity_of(byte) for byte in data)

    def decode(self, data: bytes) -> bytes:
        """The bytes without their parity; ``DAMAGED`` where it is wrong."""
        return bytes(one & ~BIT_7 if one >> 7 == self._parity_of(one & ~BIT_7) else DAMAGED for one in data)

    def _parity_of(self, character: int) -> int:
        return (character.bit_count() + self._odd) % 2


def in_software(settings: dict[str, object]) -> ParityInBit7 | None:
    """Take the parity out of the settings of a line, if it is to be checked in software.

    ``settings`` are those of pyserial and ``parity_check``, which is removed from them: ``terminal``, or
    ``software`` for lines that pass eight bits on, of which the last is the parity. A network server set
    to 8N2 has no terminal that could check it for a gauge with 7E2.

    Raises:
        FileError: ``parity_check`` is unknown, or the line has not seven bits with a parity.
    """
    word = settings.pop("parity_check", "terminal")
    if word == "terminal":
        return None
    if word != "software":
        raise _refused(f"parity_check {word!r} is unknown", "Write 'terminal' or 'software'")
    odd = ODD_BITS.get(str(settings.get("parity", "N")))
    if odd is None or settings.get("bytesize") != 7:
        raise _refused("parity_check 'software' wants 7 bits and a parity", "Write bytesize and parity too")
    settings.update(bytesize=8, parity="N")
    return ParityInBit7(odd)


def have_terminal_check(port: object, settings: Mapping[str, object]) -> None:
    """Have the terminal behind an opened port of pyserial mark bytes of wrong parity, if it is one."""
    descriptor = getattr(port, "fd", None)
    if descriptor is None or settings.get("parity", "N") not in ODD_BITS:
        return
    with suppress(termios.error):  # a pseudo-terminal has no parity
        attributes = termios.tcgetattr(descriptor)
        attributes[IFLAG] |= termios.INPCK | termios.PARMRK
        attributes[IFLAG] &= ~termios.IGNPAR
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


def _refused(problem: str, action: str) -> FileError:
    return FileError(f"its serial settings are refused: {problem}", action=f"{action} in its serial table")
