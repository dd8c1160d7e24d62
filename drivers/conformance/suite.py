"""What all conformance tests ask of failures: an error of the device, that names it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from hexacell.errors import DeviceError

LONGEST_S = 60.0
"""No call may take longer, whatever the device does."""


async def failure(call: Callable[[], Awaitable[Any]]) -> Exception | None:
    """What a call raises; none if it succeeds."""
    try:
        await call()
    except Exception as error:
        return error
    return None


def require_named(error: BaseException | None, name: str) -> None:
    """Fail unless it is a ``DeviceError`` whose subject has the name in it."""
    assert isinstance(error, DeviceError), f"{error!r} is no DeviceError"
    assert name in (error.subject or ""), f"{error} does not name {name}"
