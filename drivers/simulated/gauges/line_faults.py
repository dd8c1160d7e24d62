"""Faults of a simulated gauge's line: what comes of an answer on its way, and how late."""

from __future__ import annotations

import re
from collections.abc import Callable
from enum import StrEnum

import numpy as np

LATE_TIMEOUTS = 1.5
"""A late answer comes after so many of the driver's time-outs."""

LATE_EVERY = 4
DAMAGED_EVERY = 5
NULS = b"\0\0"
VALUE = re.compile(rb"\d\.\d|[\x03\x04]")
"""Of an answer with a value: a number, or a function of Modbus that reads registers."""


class LineFault(StrEnum):
    """A fault of a line, by its name in a cell file."""

    DAMAGED = "damaged"
    CUT_SHORT = "cut short"
    REPEATED = "repeated"
    UNASKED = "unasked"
    LATE = "late"
    ECHOING = "echoing"
    NUL_BYTES = "NUL bytes"


class LineFaults:
    """The faults of one line that are on. Used by the thread of the line; switched from any."""

    def __init__(self, late_s: float, seed: int = 1) -> None:
        self._late_s = late_s
        self._on: set[LineFault] = set()
        self._random = np.random.default_rng(seed)
        self._answers = 0
        self._latest = b""

    def switch(self, fault: LineFault, *, on: bool) -> None:
        """Inject a fault, or clear it."""
        self._on = self._on | {fault} if on else self._on - {fault}

    def delay_s(self) -> float:
        """Real seconds by which the next answer is later."""
        is_late = LineFault.LATE in self._on and self._answers % LATE_EVERY == 0
        return self._late_s if is_late else 0.0

    def sent(self, command: bytes, answer: bytes) -> bytes:
        """What is sent instead of an answer."""
        self._answers += 1
        if not answer:
            return answer
        unchanged, before = answer, self._latest
        changes: dict[LineFault, Callable[[bytes], bytes]] = {
            LineFault.DAMAGED: self._damaged,
            LineFault.CUT_SHORT: self._cut,
            LineFault.REPEATED: lambda sent: sent + unchanged,
            LineFault.UNASKED: lambda sent: before + sent,
            LineFault.ECHOING: lambda sent: command + b"\r" + sent,
            LineFault.NUL_BYTES: lambda sent: NULS + sent,
        }
        for fault, change in changes.items():
            if fault in self._on:
                answer = change(answer)
        if VALUE.search(unchanged):
            self._latest = unchanged
        return answer

    def _damaged(self, answer: bytes) -> bytes:
        """One bit of each fifth answer is another."""
        if self._answers % DAMAGED_EVERY:
            return answer
        place = int(self._random.integers(len(answer)))
        changed = answer[place] ^ 1 << int(self._random.integers(7))
        return answer[:place] + bytes((changed,)) + answer[place + 1 :]

    def _cut(self, answer: bytes) -> bytes:
        """Each fifth answer ends too early."""
        return answer if self._answers % DAMAGED_EVERY else answer[: len(answer) // 2]
