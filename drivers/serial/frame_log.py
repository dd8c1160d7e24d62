"""Frames of a line that sends unasked, each with a time before which it cannot have begun to come."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass

LINE_END = re.compile(rb"[\r\n\0]+")
LOG_LENGTH = 256
FRAME_LIMIT = 256


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

    A frame that comes twice at once is one: a copy confirms nothing.
    """

    def __init__(self) -> None:
        self._frames: deque[StreamedFrame] = deque(maxlen=LOG_LENGTH)
        self._count = 0
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
                self._count += 1
                self._frames.append(StreamedFrame(self._count, self._begun_after_s, line))
            before = line or before
            self._begun_after_s = came_after_s
        self._begun = begun[-FRAME_LIMIT:]

    def after(self, number: int) -> tuple[StreamedFrame, ...]:
        """The frames after one, oldest first."""
        return tuple(frame for frame in tuple(self._frames) if frame.number > number)

    @property
    def count(self) -> int:
        """How many frames there were."""
        return self._count
