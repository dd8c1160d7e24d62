"""Cutting frames out of what a line delivers; pure functions on bytes."""

from __future__ import annotations

LINE_ENDS = b"\r\n"


def cut_frame(received: bytes, request: bytes, terminator: bytes) -> tuple[bytes, bytes] | None:
    """The first whole frame in ``received``, ``terminator`` included, and the bytes behind it.

    Line ends before the frame are left out (some devices end lines with more than they document),
    and so is the echo of ``request`` that some devices send. None as long as no frame is whole.
    """
    body = received.lstrip(LINE_ENDS).removeprefix(request).lstrip(LINE_ENDS)
    head, end, rest = body.partition(terminator)
    return (head + end, rest) if end else None
