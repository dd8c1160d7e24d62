"""Why a notice could not be told."""

from __future__ import annotations

from hexacell.errors import DeviceError


class NoticeUndelivered(DeviceError):
    """Who is to be told did not take a notice; the message has no secret."""
