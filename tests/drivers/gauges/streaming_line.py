"""A fake line that sends by itself, at times of the fake port's clock."""

from __future__ import annotations

from typing import Any

from tests.drivers.serial.port_time import SLICE_S

GAP_S = 2 * SLICE_S


class StreamingLine:
    """What a scripted port sends while somebody waits for bytes."""

    def __init__(self, dialogue: Any) -> None:
        self._dialogue = dialogue
        self._planned: list[tuple[float, bytes]] = []
        self._repeated, self._next_s = b"", 0.0
        wait = dialogue.time.wait_for_bytes

        def wait_and_send() -> None:
            wait()
            self._send_due()

        dialogue.time.wait_for_bytes = wait_and_send

    def repeats(self, data: bytes, first: bytes = b"", first_at_s: float = 0.0) -> None:
        """From now on send ``data`` again and again, ``first`` once before."""
        now = self._dialogue.time.now_s
        self._repeated, self._next_s = data, now + first_at_s + GAP_S
        if first:
            self._planned.append((now + first_at_s, first))

    def stops(self) -> None:
        """Send no more."""
        self._repeated = b""

    def at_s(self, after_s: float, data: bytes) -> None:
        """Send ``data`` so long after now, and nothing else."""
        self.stops()
        self._planned.append((self._dialogue.time.now_s + after_s, data))

    def backlog(self, data: bytes) -> None:
        """What came while nobody read."""
        self._dialogue.unasked(data)

    def _send_due(self) -> None:
        now = self._dialogue.time.now_s
        while self._planned and self._planned[0][0] <= now:
            self._dialogue.pending += self._planned.pop(0)[1]
        if self._repeated and now >= self._next_s:
            self._next_s = now + GAP_S
            self._dialogue.pending += self._repeated
