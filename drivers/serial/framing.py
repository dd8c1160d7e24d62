"""Frames among received bytes."""

from __future__ import annotations

LINE_ENDS = b"\r\n\0"  # and the NUL bytes that lines put before a frame when they are switched
LINE_END_BYTES = frozenset({b"\r", b"\n", b"\0"})


def cut_frame(received: bytes, request: bytes, terminator: bytes) -> tuple[bytes, bytes] | None:
    """The first complete frame in ``received``, ``terminator`` included, and the bytes after it.

    Line ends and NUL bytes before the frame are removed, since some devices send more than documented, and
    so is the echo of ``request`` that some devices send, with any line end. None as long as no frame is
    complete.
    """
    body = received.lstrip(LINE_ENDS).removeprefix(request).lstrip(LINE_ENDS)
    words = request.rstrip(LINE_ENDS)
    if words and body[len(words) :][:1] in LINE_END_BYTES:
        body = body.removeprefix(words).lstrip(LINE_ENDS)
    head, end, rest = body.partition(terminator)
    return (head + end, rest) if end else None


def is_copies(surplus: bytes, frame: bytes) -> bool:
    """Whether ``surplus`` is nothing, or ``frame`` once more or several times."""
    return not surplus.replace(frame, b"").strip(LINE_ENDS) if frame else not surplus.strip(LINE_ENDS)
