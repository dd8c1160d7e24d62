"""Errors of serial ports: each function builds one, with the next action."""

from __future__ import annotations

import errno

from hexacell.errors import DeviceError, FileError

_CAUSES = {
    errno.ENOENT: ("is absent", "Plug it in or correct port in the cell file"),
    errno.ENODEV: ("is absent", "Plug it in or correct port in the cell file"),
    errno.ENXIO: ("is absent", "Plug it in or correct port in the cell file"),
    errno.EACCES: ("may not be opened by this user", "Let the user into the group that owns it"),
    errno.EPERM: ("may not be opened by this user", "Let the user into the group that owns it"),
    errno.EBUSY: ("is in use", "Close the other program that has it open"),
    errno.EAGAIN: ("is in use", "Close the other program that has it open"),
}


class PortLost(DeviceError):
    """A port is not available, or was lost."""


def port_open_failed(subject: str, url: str, error: BaseException) -> DeviceError:
    """Opening the port failed with ``error``, an ``OSError`` or a ``termios.error``."""
    problem, action = _CAUSES.get(
        getattr(error, "errno", None) or 0,
        (f"cannot be opened: {error}", "Check the device and port in the cell file"),
    )
    return PortLost(f"port {url} {problem}", subject=subject, action=action)


def settings_rejected(subject: str, url: str, error: BaseException) -> FileError:
    """The URL or one of the settings is not accepted by pyserial."""
    return FileError(
        f"port {url} or its serial settings are refused: {error}",
        subject=subject,
        action="Correct port or serial in the cell file",
    )


def port_lost(subject: str, url: str, reason: str) -> DeviceError:
    """An open port is gone."""
    return PortLost(
        f"port {url} was lost ({reason})",
        subject=subject,
        action="Plug it in and open the device again; its zero is void",
    )


def port_closed(subject: str, url: str) -> DeviceError:
    """The port is closed, or being closed, by this program."""
    return PortLost(f"port {url} is closed", subject=subject)


def line_not_silent(subject: str, url: str) -> DeviceError:
    """The device sends continuously, so an answer cannot be recognised."""
    return DeviceError(
        f"the device on {url} keeps sending unasked",
        subject=subject,
        action="Switch its continuous output off, or correct port and protocol in the cell file",
    )
