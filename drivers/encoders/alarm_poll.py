"""Reading of alarm entries: some alarms come without an emergency, and stand in 1001h and 6503h only."""

from __future__ import annotations

import time
from collections.abc import Sequence

from drivers.encoders.canopen_node import EncoderNode
from drivers.encoders.node_monitor import NodeMonitor, invalid_sample
from drivers.encoders.object_dictionary import ALARMS, ERROR_REGISTER, WARNINGS, ObjectEntry

ALARM_POLL_S = 0.1
"""Shortest period at which the alarm entries are read."""

BUS_SHARE = 0.02
"""Of the time of samples that follow each other without a pause, so much goes to reading alarm entries."""

WARNINGS_EVERY = 10
"""Warnings are read at each such reading only: an SDO takes as long as a position."""

_COMMUNICATION = 0x10
"""Bit of the error register for communication errors, which do not concern positions."""


class AlarmPoll:
    """Reads the alarm entries of all nodes: at first, after emergencies, and every ``ALARM_POLL_S``.

    On a slow bus such a reading takes a quarter of that. Where samples follow each other without a pause it
    is put off therefore, until it is no more than ``BUS_SHARE`` of the time.
    """

    def __init__(self, nodes: Sequence[EncoderNode], monitors: Sequence[NodeMonitor]) -> None:
        self._monitors = monitors
        self._emergencies_seen = -1
        self._polls = 0
        self._begun_s = self._polled_s = self._sampling_s = self._cost_s = 0.0
        self._entries = [
            (node, entry)
            for node in nodes
            for entry in (ERROR_REGISTER, ALARMS, WARNINGS)
            if node.read_optional(entry) is not None
        ]
        # A warning from before is told when the encoders are opened, and need not end every run.
        self._known = {
            (node, entry): node.read(entry) for node, entry in self._entries if entry is WARNINGS
        }
        self.begin_sample()
        self.check()

    def begin_sample(self) -> None:
        """A sample is taken from now on until :meth:`check`."""
        self._begun_s = time.monotonic()

    def check(self) -> None:
        """Read the alarm entries if they are due.

        Raises:
            InvalidSampleError: there is an alarm.
        """
        now_s = time.monotonic()
        self._sampling_s += now_s - self._begun_s
        emergencies = sum([monitor.emergencies for monitor in self._monitors])
        if emergencies == self._emergencies_seen and not self._is_due(now_s):
            return
        self._polls += 1
        self._emergencies_seen = -1  # due again at once, should one be found
        for node, entry in self._entries:
            if entry is not WARNINGS or self._polls % WARNINGS_EVERY == 0:
                self._check_entry(node, entry)
        self._emergencies_seen = emergencies
        self._polled_s, self._sampling_s = time.monotonic(), 0.0
        self._cost_s = self._polled_s - now_s

    def _is_due(self, now_s: float) -> bool:
        since_s = now_s - self._polled_s
        has_paused = since_s >= 2.0 * self._sampling_s
        return since_s >= ALARM_POLL_S and (has_paused or BUS_SHARE * since_s >= self._cost_s)

    def _check_entry(self, node: EncoderNode, entry: ObjectEntry) -> None:
        value = node.read(entry)
        if entry is ERROR_REGISTER:
            value &= ~_COMMUNICATION
        if value & ~self._known.get((node, entry), 0):
            word = "a warning" if entry is WARNINGS else "an alarm"
            raise invalid_sample(f"has {word} ({entry} is {value:#06x})", node.leg.subject)
