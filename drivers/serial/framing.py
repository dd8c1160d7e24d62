"""Frames among received bytes: of answers, and of a line that sends unasked."""

import re
from collections import deque
from dataclasses import dataclass

LINE_ENDS = b"\r\n\0"
"""Ends of lines, and the NUL bytes that lines put before a frame when they are switched."""
LINE_END = re.compile(rb"[\r\n\0]+")
LOG_LENGTH = 256
FRAME_LIMIT = 256


def cut_frame(received: bytes, request: bytes, terminator: bytes) -> tuple[bytes, bytes] | None:
    """The first complete frame in ``received``, ``terminator`` included, and the bytes after it.

    Line ends and NUL bytes before the frame are removed, since some devices send more than documented, and
    so is the echo of ``request`` that some devices send, with any line end. None as long as no frame is
    complete.
    """
    body = received.lstrip(LINE_ENDS).removeprefix(request).lstrip(LINE_ENDS)
    words = request.rstrip(LINE_ENDS)
    if words and LINE_END.match(body, len(words)):
        body = body.removeprefix(words).lstrip(LINE_ENDS)
    head, end, rest = body.partition(terminator)
    return (head + end, rest) if end else None


def is_copies(surplus: bytes, frame: bytes) -> bool:
    """Whether ``surplus`` is nothing, or ``frame`` once more or several times."""
    return not surplus.replace(frame, b"").strip(LINE_ENDS) if frame else not surplus.strip(LINE_ENDS)


@dataclass(frozen=True, slots=True)
class StreamedFrame:
    """A line of text without its end.

    Attributes:
        number: of the frame, counted from 1.
        began_after_s: its first byte came after this time, s of the port's clock.
    """

    number: int
    began_after_s: float
    data: bytes


class FrameLog:
    """The latest frames. Bytes that nobody read for a while are as old as the last look at the line.

    A frame that comes twice at once is one: a copy confirms nothing. ``count`` is how many there were.
    """

    def __init__(self) -> None:
        self.count = 0
        self._frames: deque[StreamedFrame] = deque(maxlen=LOG_LENGTH)
        self._begun = b""
        self._begun_after_s = 0.0

    def add(self, data: bytes, came_after_s: float) -> None:
        """Take bytes that were read together, all of which came after a time."""
        if not self._begun:
            self._begun_after_s = came_after_s
        *lines, begun = LINE_END.split(self._begun + data)
        before = b""
        for line in lines:
            if line and line != before:
                self.count += 1
                self._frames.append(StreamedFrame(self.count, self._begun_after_s, line))
            before = line or before
            self._begun_after_s = came_after_s
        self._begun = begun[-FRAME_LIMIT:]

    def after(self, number: int) -> tuple[StreamedFrame, ...]:
        """The frames after one, oldest first."""
        return tuple(frame for frame in tuple(self._frames) if frame.number > number)
