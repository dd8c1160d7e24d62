"""Opens a serial port with pyserial, for this program's exchanges or for those of a library."""

from __future__ import annotations

import errno
import termios
import threading
from collections.abc import Mapping

import serial

from drivers.errors import PortLost
from drivers.serial.errors import opening_errors

SLICE_S = 0.05
WRITE_SLICE_S = 0.2
OPEN_TRIES = 20
WITHOUT_WRITE_TIMEOUT = (
    "rfc2217://"  # pyserial has none there, and refuses to open with one (its issue 412)
)


def opened_port(
    url: str,
    settings: Mapping[str, object],
    subject: str,
    closing: threading.Event,
    inter_byte_timeout_s: float | None = None,
) -> serial.Serial:
    """The port, open; ``settings`` are those of pyserial, ``dtr`` and ``rts``. ``closing`` interrupts it.

    Raises:
        PortLost: The port is absent, in use, or cannot be opened, or ``closing`` is set.
        FileError: pyserial does not accept the URL or a setting.
    """
    attempts = 0
    with opening_errors(subject, url):
        port = _configured(url, settings)
        port.inter_byte_timeout = inter_byte_timeout_s
        while not port.is_open:
            attempts += 1
            try:
                port.open()
            except termios.error as error:
                if attempts == OPEN_TRIES or not _refuses_parity(error):
                    raise
                if closing.wait(SLICE_S):
                    raise PortLost(f"port {url} is closed", subject=subject) from error
    return port


def _configured(url: str, given: Mapping[str, object]) -> serial.Serial:
    lines = {name: value for name, value in given.items() if name in {"dtr", "rts"}}
    settings = {name: value for name, value in given.items() if name not in lines}
    port = serial.serial_for_url(url, do_not_open=True, **settings)  # type: ignore[arg-type]
    port.timeout = SLICE_S  # set once and before opening: a pseudo-terminal refuses later changes
    if not url.lower().startswith(WITHOUT_WRITE_TIMEOUT):
        port.write_timeout = WRITE_SLICE_S
    for name, level in lines.items():
        setattr(port, name, level)
    return port


def _refuses_parity(error: termios.error) -> bool:
    """Whether a pseudo-terminal refused parity, as it does until its server has reset its speed.

    glibc's ``tcsetattr`` succeeds if it changed anything at all, so the first open passes and the
    next one, with nothing left to change, fails (pyserial issue 196).
    """
    return bool(error.args[:1] == (errno.EINVAL,))
