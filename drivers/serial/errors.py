"""What pyserial raises while a port is opened, as errors with the next action."""

from __future__ import annotations

import errno
import termios
from collections.abc import Iterator
from contextlib import contextmanager

from drivers.errors import PortLost
from hexacell.errors import FileError

_ABSENT = ("is absent", "Plug it in or correct port in the cell file")
_NOT_PERMITTED = ("may not be opened by this user", "Let the user into the group that owns it")
_IN_USE = ("is in use", "Close the other program that has it open")

_CAUSES = {
    errno.ENOENT: _ABSENT,
    errno.ENODEV: _ABSENT,
    errno.ENXIO: _ABSENT,
    errno.EACCES: _NOT_PERMITTED,
    errno.EPERM: _NOT_PERMITTED,
    errno.EBUSY: _IN_USE,
    errno.EAGAIN: _IN_USE,
}


def lost_port(subject: str, url: str, reason: str, action: str = "Plug it in") -> PortLost:
    """The error for the port ``url``, which was open."""
    return PortLost(
        f"port {url} was lost ({reason})",
        subject=subject,
        action=f"{action} and open the device again; its zero is void",
    )


@contextmanager
def opening_errors(subject: str, url: str) -> Iterator[None]:
    """Convert the errors of opening the port ``url``.

    Raises:
        PortLost: The port is absent, in use, or cannot be opened.
        FileError: pyserial does not accept the URL or a setting.
    """
    try:
        yield
    except (ValueError, TypeError) as error:
        raise FileError(
            f"port {url} or its serial settings are refused: {error}",
            subject=subject,
            action="Correct port or serial in the cell file",
        ) from error
    except (OSError, termios.error) as error:
        problem, action = _CAUSES.get(
            getattr(error, "errno", None) or 0,
            (f"cannot be opened: {error}", "Check the device and port in the cell file"),
        )
        raise PortLost(f"port {url} {problem}", subject=subject, action=action) from error
