"""Errors that a device keeps in its dictionary: 1001h and 6503h, looked at now and then."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.encoders.node import EncoderNode
from drivers.encoders.objects import ALARMS, ERROR_REGISTER, Entry
from drivers.encoders.watch import NodeWatch, invalid

PERIOD_S = 0.1
"""A device that raises an alarm without an emergency message is found out after so long."""

_COMMUNICATION = 0x10
"""Bit of the error register that says nothing about positions."""


@dataclass(frozen=True, slots=True)
class _Supported:
    node: EncoderNode
    entries: tuple[Entry, ...]


class AlarmPoll:
    """Reads the error entries of all nodes: at once, then every ``PERIOD_S`` and after emergencies.

    Raises:
        NodeError: As :meth:`check`.
    """

    def __init__(self, nodes: Sequence[EncoderNode], watches: Sequence[NodeWatch]) -> None:
        self._watches = watches
        self._seen = -1
        self._due = 0.0
        self._supported = [
            _Supported(node, tuple(entry for entry in (ERROR_REGISTER, ALARMS) if _has(node, entry)))
            for node in nodes
        ]
        self.check()

    def check(self) -> None:
        """Look if it is time to.

        Raises:
            InvalidSampleError: A device has an alarm.
            NodeError: It does not answer.
        """
        emergencies = sum(watch.emergencies for watch in self._watches)
        if time.monotonic() < self._due and emergencies == self._seen:
            return
        for supported in self._supported:
            _check(supported)
        self._seen = emergencies
        self._due = time.monotonic() + PERIOD_S


def _has(node: EncoderNode, entry: Entry) -> bool:
    return node.read_optional(entry) is not None


def _check(supported: _Supported) -> None:
    for entry in supported.entries:
        value = supported.node.read(entry)
        if entry is ERROR_REGISTER:
            value &= ~_COMMUNICATION
        if value:
            raise invalid(f"has an alarm ({entry} is {value:#06x})", supported.node.leg)
